"""Arrows point down only, between packages and inside them, and there is one circle."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from import_graph import circles, import_graph, imports, modules

REST = "*"
"""All files of the package that no layer names."""
LAYERS: dict[str, list[tuple[str, ...]]] = {
    "lsu_mesh": [
        ("errors", "array_types", "lazy_exports"),
        ("kernels",),
        ("supports",),
        ("model_arguments",),
        ("model",),
        ("nonlinear",),
        ("systems", "simulation", "metrics", "bank_simulation"),
        ("filters", "fusion"),
        ("identification", "testing"),
        ("rate_identification",),
        ("experiments", "mesh"),
    ],
    "lsu_mesh.kernels": [
        ("runtime",),
        ("intervals",),
        ("linear_programs", "parallelotopes", "zonotopes", "discretisation", "plain_outputs"),
        ("points",),
        ("filter_step", "plant_step", "run_tables"),
        ("filter_point",),
        ("batch_run", "set_run"),
    ],
    "lsu_mesh.kernels.intervals": [
        ("constants", "double_double", "operations"),
        ("exponential", "trigonometric", "inverse_trigonometric", "directed"),
        ("arithmetic",),
        ("functions",),
        ("tape",),
        ("enclosure",),
    ],
    "lsu_mesh.nonlinear": [("graph",), ("functions", "language", "periodic"), ("model",), ("steps",)],
    "lsu_mesh.kernels.runtime": [("compile", "unowned_views"), ("splicing",), (REST,)],
    "lsu_mesh.kernels.linear_programs": [
        ("banded_program", "bordered_systems", "dual_bound", "simplex"),
        ("newton_step", "safe_maxima"),
        ("implied_ranges", "interior_point", "vertex_enumeration"),
        ("window_program",),
    ],
    "lsu_mesh.kernels.parallelotopes": [
        ("strip_update", "edge_selection", "enclosure"),
        ("box", "parallelotope"),
        ("bundle",),
    ],
    "lsu_mesh.kernels.points": [("normal", "room"), (REST,), ("stretch_noise",)],
    "lsu_mesh.kernels.zonotopes": [
        ("zonotope", "lifted_zonotope"),
        ("constrained_zonotope", "constraint_elimination", "generator_reduction", "time_update", "parallel_generators"),
        ("complexity_reduction", "stack_reduction", "zonotopic_kalman", "packed_set"),
        ("constrained_step",),
        ("kalman_step",),
    ],
    "lsu_mesh.supports": [
        ("arrays", "exact", "exact_program", "polytope"),
        ("linear_programs",),
        ("reduction",),
        (REST,),
        ("intersection",),
        ("nearest_point",),
    ],
    "lsu_mesh.filters": [
        ("point_rule",),
        ("validation",),
        ("density",),
        ("filter", "inconsistency", "last_met", "transfer_gain", "plain_outputs"),
        ("lagged_states", "compiled_loop"),
        ("compiled", "compiled_sets", "constrained_intersection", "constrained_state", "window"),
        ("zonotopic_state",),
        (REST,),
        ("registry", "run"),
        ("bank", "warm_up"),
    ],
    "lsu_mesh.filters.window": [
        ("structure", "interval_estimate", "highs"),
        ("program",),
        ("state",),
        ("batch_map", "window_map"),
    ],
    "lsu_mesh.fusion": [("point", "stack"), ("intersection",), (REST,), ("policies",), ("fuse",)],
    "lsu_mesh.mesh": [
        ("keys", "messages", "ledger", "unknown_fields", "grid"),
        ("bank_messages",),
        ("message_examples", "sets", "data_files", "ros2", "json_form", "sequences", "lost_messages"),
        ("config",),
        (
            "access",
            "input_time",
            "live_times",
            "measurement_time",
            "model_answer",
            "processes",
            "start_agreement",
            "time_requirements",
        ),
        ("duplicate_process", "duplicate_publishers"),
        ("admission",),
        ("flows",),
        ("estimation",),
        ("nodes",),
        ("observer", "replay", "verification"),
        ("ros2_telling",),
        ("simulator",),
    ],
    "lsu_mesh.mesh.config": [
        ("problem", "toml_lines", "write", "measurement_files", "digest", "instances"),
        ("expected", "settings"),
        ("table",),
        (REST,),
        ("load",),
    ],
    "lsu_mesh.mesh.nodes": [
        ("node", "schedule"),
        ("rate_limit", "source_timeout", "useless_data"),
        (REST,),
        ("filter", "fusion"),
    ],
    "lsu_mesh.mesh.verification": [
        ("archive",),
        ("provenance_steps", "containment", "recomputed"),
        (REST,),
        ("comparison",),
        ("side_by_side",),
        ("verify",),
    ],
    "lsu_mesh.mesh.simulator": [
        ("broken", "external_sensor", "decoding", "recorder"),
        ("faults",),
        (REST,),
        ("mesh",),
        ("run",),
        ("campaign",),
    ],
    "lsu_mesh.experiments": [
        ("outcome", "effect", "workers", "transfer_result", "machine_facts"),
        ("comparison", "monte_carlo", "page"),
        (REST,),
    ],
    "lsu_mesh.experiments.mesh_speed": [
        ("quantiles", "mesh_case", "bench_kinds", "benchmark_mesh", "growth"),
        ("local_steps", "mesh_report", "bench_file"),
        ("throughput", REST),
        ("scale",),
        ("scale_page",),
    ],
    "lsu_mesh_services": [
        ("exit_codes", "extras", "stop", "client"),
        ("forking",),
        ("supervisor",),
        ("options",),
        ("network",),
        ("bus",),
        ("session", "configuration", "mesh_start", "bank_limits"),
        ("recording", "monitoring"),
        ("viewers", "peer", "bank_answers", "recorder", "played_files", "published_lines", "new_mesh", "gateway"),
        ("ros2",),
        ("mesh_launcher",),
        ("benchmarks",),
        ("replay",),
        ("commands",),
        ("cli",),
        ("__main__", "fork_server"),
    ],
    "lsu_mesh_services.options": [("parsing",), (REST,)],
    "lsu_mesh_services.network": [("access_control",), (REST,), ("session_settings",)],
    "lsu_mesh_services.benchmarks": [
        ("checkout", "process_usage", "keep_results", "table"),
        ("process_group",),
        ("relay_plan",),
        ("relay_process",),
        ("sides",),
        ("measured_run",),
        ("turns", "start"),
        (REST,),
    ],
    "lsu_mesh_services.recording": [
        (
            "entity_paths",
            "timeline",
            "palette",
            "container",
            "timeout",
            "part_files",
            "rerun_programs",
            "set_geometry",
            "synthetic_mesh",
        ),
        ("bands", "raw", "frame"),
        ("banks",),
        ("read", "blueprint", REST),
        ("stream",),
        ("parted_stream",),
        ("recorder", "export", "summary"),
        ("cost",),
    ],
}
"""From the lowest layer to the highest; a module imports from its own layer and from those below.

A package that stands here names each of its files and folders, or says where the rest belongs. Inside a layer, and
inside a package that does not stand here, the files import each other in any order that makes no circle.
"""
CIRCLE = {f"lsu_mesh.supports.{name}" for name in (
    "constrained_zonotope", "orthotope", "parallelotope", "support", "zonotope",
)}  # fmt: skip
"""Each set converts itself into the others, which is what their one contract asks of them."""


@pytest.fixture(scope="module")
def graph(root: Path) -> dict[str, set[str]]:
    return import_graph(modules(root))


def layer_of(package: str, module: str) -> int | None:
    """The layer of the file or folder of the package in which the module lies."""
    part = module.removeprefix(f"{package}.").split(".")[0]
    layers = LAYERS[package]
    named = next((i for i, layer in enumerate(layers) if part in layer), None)
    return named if named is not None else next((i for i, layer in enumerate(layers) if REST in layer), None)


def test_every_module_has_a_place_in_the_house(graph: dict[str, set[str]]) -> None:
    homeless = [
        f"{module}: give it a layer of {package} in tests/test_architecture.py"
        for package in LAYERS
        for module in graph
        if module.startswith(f"{package}.") and layer_of(package, module) is None
    ]
    assert homeless == []


def test_arrows_point_down_only(graph: dict[str, set[str]]) -> None:
    wrong = [
        f"{module} imports {imported}"
        for package in LAYERS
        for module in graph
        for imported in graph[module]
        if module.startswith(f"{package}.") and imported.startswith(f"{package}.")
        if (layer_of(package, imported) or 0) > (layer_of(package, module) or 0)
    ]
    assert wrong == []


def test_there_is_one_circle(graph: dict[str, set[str]]) -> None:
    assert circles(graph) == [CIRCLE]


def test_a_circle_is_found() -> None:
    graph = {"a": {"b"}, "b": {"c", "d"}, "c": {"a"}, "d": set(), "e": {"d", "f"}, "f": {"e"}}
    assert sorted(map(sorted, circles(graph))) == [["a", "b", "c"], ["e", "f"]]


def test_an_arrow_up_is_found() -> None:
    assert layer_of("lsu_mesh", "lsu_mesh.kernels.runtime.compile") == 1
    assert layer_of("lsu_mesh.kernels", "lsu_mesh.kernels.runtime.compile") == 0
    assert layer_of("lsu_mesh.kernels", "lsu_mesh.kernels.unheard_of") is None


def test_folders_of_papers_do_not_import_each_other(graph: dict[str, set[str]]) -> None:
    def paper(module: str) -> str | None:
        parts = module.split(".")
        return parts[2] if parts[:2] == ["lsu_mesh", "experiments"] and len(parts) > 3 else None

    shared = [
        f"{module} imports {imported}"
        for module in graph
        for imported in graph[module]
        if paper(module) and paper(imported) and paper(module) != paper(imported)
    ]
    assert shared == []


def test_types_of_arrays_have_one_home(root: Path) -> None:
    elsewhere = [
        f"{name}: {line}"
        for name, path in modules(root).items()
        for line in path.read_text(encoding="utf-8").splitlines()
        if line[:1].isupper() and " = NDArray[" in line and name != "lsu_mesh.array_types"
    ]
    assert elsewhere == []


def test_the_library_imports_neither_zenoh_nor_rerun_nor_messagepack(root: Path) -> None:
    for name, path in modules(root).items():
        tops = {imported.split(".")[0] for imported in imports(path)}
        if name.partition(".")[0] == "lsu_mesh":
            assert not tops & {"zenoh", "rerun", "lsu_mesh_services", "rich"}, name
        if name.startswith("lsu_mesh.") and not name.startswith("lsu_mesh.mesh"):
            assert not tops & {"msgspec", "msgpack"}, name


def test_only_the_bus_and_the_client_import_zenoh_and_only_the_recording_imports_rerun(root: Path) -> None:
    for name, path in modules(root).items():
        tops = {imported.split(".")[0] for imported in imports(path)}
        assert ("zenoh" in tops) <= (name in ("lsu_mesh_services.bus", "lsu_mesh_services.client")), name
        assert ("rerun" in tops) <= name.startswith("lsu_mesh_services.recording"), name


def test_the_client_is_one_file_that_can_be_copied(root: Path) -> None:
    tops = {name.split(".")[0] for name in imports(root / "services" / "lsu_mesh_services" / "client.py")}
    assert tops - set(sys.stdlib_module_names) == {"zenoh", "msgpack", "numpy"}, "numpy only where it is asked for"
    heavy = ("numpy", "msgspec", "lsu_mesh", "asyncio", "ssl")
    check = f"import lsu_mesh_services.client, sys\nprint([name for name in {heavy} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("program", "forbidden"),
    [
        (
            "from lsu_mesh_services.cli import build_parser; build_parser().format_help()",
            ("zenoh", "rerun", "numba", "scipy", "numpy"),
        ),
        ("import lsu_mesh", ("zenoh", "rerun", "msgspec", "msgpack", "numba", "scipy")),
        ("from lsu_mesh import LSUO", ("zenoh", "rerun", "msgspec", "msgpack")),
    ],
)
def test_imports_happen_when_they_are_needed(root: Path, program: str, forbidden: tuple[str, ...]) -> None:
    check = f"{program}\nimport sys\nprint([name for name in {forbidden!r} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", check], cwd=root, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_the_help_of_the_command_comes_without_heavy_imports(root: Path) -> None:
    check = (
        "import sys\nfrom lsu_mesh_services.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "print([name for name in ('zenoh', 'rerun', 'numba', 'scipy') if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", check], cwd=root, capture_output=True, text=True, check=True)
    assert "exit codes" in result.stdout
    assert result.stdout.strip().endswith("[]")
