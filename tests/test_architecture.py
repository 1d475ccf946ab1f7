"""Arrows point down only."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

LAYERS = {
    "lsu_mesh.errors": 0,
    "lsu_mesh.kernels": 1,
    "lsu_mesh.supports": 2,
    "lsu_mesh.model": 3,
    "lsu_mesh.systems": 4,
    "lsu_mesh.simulation": 4,
    "lsu_mesh.metrics": 4,
    "lsu_mesh.filters": 5,
    "lsu_mesh.fusion": 5,
    "lsu_mesh.identification": 6,
    "lsu_mesh.testing": 6,
    "lsu_mesh.experiments": 6,
    "lsu_mesh.mesh": 7,
    "lsu_mesh_services": 8,
}
"""A module imports only from its own layer (and package) and from those below."""
FACADE = "lsu_mesh"


def modules(root: Path) -> Iterator[tuple[str, Path]]:
    for home, package in ((root, "lsu_mesh"), (root / "services", "lsu_mesh_services")):
        for path in sorted((home / package).rglob("*.py")):
            parts = path.relative_to(home).with_suffix("").parts
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def imports(path: Path, *, runtime: bool) -> set[str]:
    """Full names that a file imports; with ``runtime`` without those for type checkers only."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    skipped = {
        child
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for child in ast.walk(node)
    }
    found = set()
    for node in ast.walk(tree):
        if runtime and node in skipped:
            continue
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module} | {f"{node.module}.{name.name}" for name in node.names}
    return found


def package_of(module: str) -> str | None:
    """The layer's package that a module belongs to."""
    return next((name for name in LAYERS if module == name or module.startswith(f"{name}.")), None)


def test_every_module_has_a_place_in_the_house(root: Path) -> None:
    assert [name for name, _ in modules(root) if package_of(name) is None and name != FACADE] == []


def test_arrows_point_down_only(root: Path) -> None:
    wrong = []
    for name, path in modules(root):
        own = package_of(name)
        if own is None:
            continue
        for imported in imports(path, runtime=True):
            other = package_of(imported)
            if other is None or other == own:
                continue
            if LAYERS[other] >= LAYERS[own] and not (own == "lsu_mesh.model" and other == "lsu_mesh.supports"):
                wrong.append(f"{name} imports {imported}")
    assert wrong == []


def test_the_library_imports_neither_zenoh_nor_rerun_nor_messagepack(root: Path) -> None:
    for name, path in modules(root):
        tops = {imported.split(".")[0] for imported in imports(path, runtime=False)}
        if name.partition(".")[0] == "lsu_mesh":
            assert not tops & {"zenoh", "rerun", "lsu_mesh_services", "rich"}, name
        if name.startswith("lsu_mesh.") and not name.startswith("lsu_mesh.mesh"):
            assert not tops & {"msgspec", "msgpack"}, name


def test_only_the_bus_imports_zenoh_and_only_the_recording_imports_rerun(root: Path) -> None:
    for name, path in modules(root):
        tops = {imported.split(".")[0] for imported in imports(path, runtime=False)}
        assert ("zenoh" in tops) <= (name == "lsu_mesh_services.bus"), name
        assert ("rerun" in tops) <= name.startswith("lsu_mesh_services.recording"), name


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
