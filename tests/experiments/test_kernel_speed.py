"""The bench of the kernels: it runs, what it compares is equal, and the compiled loop is far ahead of plain NumPy."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from lsu_mesh import LSUO, LSUP, LSUModel, run_filter, simulate
from lsu_mesh.experiments.kernel_speed import other_libraries
from lsu_mesh.experiments.kernel_speed.figures import exponent
from lsu_mesh.experiments.kernel_speed.hulls import exact_vertex, own_hull, random_set, relative_loss
from lsu_mesh.experiments.kernel_speed.report import FULL, JUDGED
from lsu_mesh.experiments.kernel_speed.steps import KINDS, plain_run, stable_model, unit_box
from lsu_mesh.experiments.kernel_speed.stopwatch import Candidate, compare, one_core
from lsu_mesh.kernels.linear_programs.safe_maxima import maxima, open_program

FLOOR = 20.0
"""Times that plain NumPy must at least take, on any machine however noisy; what is demanded is measured by hand."""


@pytest.fixture(scope="module")
def quick(lsu_mesh_command: list[str], tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """What ``lsu-mesh bench kernels --quick --json`` prints, and the folder with its figure."""
    pytest.importorskip("matplotlib")
    folder = tmp_path_factory.mktemp("bench") / "new"
    command = [*lsu_mesh_command, "bench", "kernels", "--quick", "--json", "--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout), folder


def test_the_quick_bench_measures_every_filter(quick: tuple[dict[str, Any], Path]) -> None:
    steps = quick[0]["steps"]
    assert {cost["kind"] for cost in steps} == set(KINDS)
    assert all(cost["single"] > 0.0 for cost in steps)
    assert all(0.0 < cost["loop"] < cost["single"] for cost in steps)
    assert all(cost["bank"] > 0.0 for cost in steps)
    assert {cost["kind"] for cost in steps if cost["numpy"] is not None} == {"LSUO", "LSUP"}


def test_the_bench_says_of_each_demand_whether_it_is_met(quick: tuple[dict[str, Any], Path]) -> None:
    demands = quick[0]["demands"]
    assert len(demands) == 10
    for demand in demands:
        measured, limit = demand["measured"], demand["limit"]
        if measured is None:
            assert demand["met"] is None
        else:
            assert demand["met"] == (measured >= limit if demand["relation"] == "≥" else measured <= limit)


def test_the_bench_compares_equal_hulls_and_imports_nothing_of_the_mesh(
    quick: tuple[dict[str, Any], Path],
) -> None:
    report = quick[0]
    assert report["imported"] == []
    assert report["hull"]["difference"]["linprog"] < 1e-9
    assert 0.0 <= report["safe_bounds"]["loss"] < 1e-12
    assert report["bank"]["steps_per_second"] > 0.0


def test_the_bench_writes_its_figure_and_its_numbers(quick: tuple[dict[str, Any], Path]) -> None:
    report, folder = quick
    assert (folder / "kernel-speed.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((folder / "kernel-speed.json").read_text()) == report


def test_the_full_bench_covers_the_sizes_that_are_demanded() -> None:
    assert FULL.sizes == (2, 3, 6, 12, 30)
    assert JUDGED in FULL.sizes
    assert FULL.instances == 10_000


@pytest.mark.parametrize(("kind", "options"), [(LSUO, {}), (LSUP, {"box": False})])
@pytest.mark.parametrize("n", [2, 3, 6])
def test_plain_numpy_does_what_the_compiled_filter_does(
    kind: Callable[..., Any], options: dict[str, bool], n: int
) -> None:
    model = stable_model(n)
    data = simulate(model, 40, seed=3)
    compiled = run_filter(kind(model, unit_box(n), **options), data.Y, data.U)
    plain = plain_run(kind.__name__, model, data, 40)
    for name in ("lower", "upper", "y_lower", "y_upper"):
        expected = np.array([getattr(row, name) for row in plain])
        np.testing.assert_allclose(getattr(compiled, name), expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(compiled.volumes, [row.volume for row in plain], rtol=1e-7)


@pytest.mark.parametrize(("name", "package"), [("warm_highs_hull", "highspy"), ("linprog_hull", "scipy")])
def test_other_solvers_find_our_hull(name: str, package: str) -> None:
    pytest.importorskip(package)
    for seed in range(5):
        body = random_set(seed)
        lower, upper = own_hull(*body)()
        low, high = getattr(other_libraries, name)(*body)()
        np.testing.assert_allclose(lower, low, atol=1e-9)
        np.testing.assert_allclose(upper, high, atol=1e-9)


def test_the_exact_vertex_solves_the_constraints_and_attains_the_maximum() -> None:
    _, G, A, b = random_set(2)
    point = maxima(open_program(A, b)[1], G)[2][0]
    xi = np.array([float(x) for x in exact_vertex(A, b, point)])
    np.testing.assert_allclose(A @ xi, b, atol=1e-12)
    best = linprog(-G[0], A_eq=A, b_eq=b, bounds=(-1, 1)).fun
    assert G[0] @ xi == pytest.approx(-best, rel=1e-12)
    assert relative_loss(A, b, G) < 1e-12


def test_a_vertex_needs_as_many_free_entries_as_constraints() -> None:
    _, _, A, b = random_set(2)
    with pytest.raises(ValueError, match="8 basic entries"):
        exact_vertex(A, b, np.zeros(20))


@pytest.mark.alone
def test_a_compiled_step_is_far_ahead_of_plain_numpy() -> None:
    """With the same work: the plain step takes the centre for a point."""
    model = stable_model(3)
    data = simulate(model, 500, seed=1)
    candidates = {
        "numpy": Candidate(lambda: plain_run("LSUO", model, data, 50), 50),
        "loop": Candidate(lambda: run_filter(LSUO(model, unit_box(3), point="centre"), data.Y, data.U), 500),
    }
    with one_core():
        cost = compare(candidates, rounds=5, seconds=0.01)
    assert cost["numpy"] / cost["loop"] > FLOOR


@pytest.mark.alone
def test_the_stopwatch_tells_work_from_more_work() -> None:
    cost = compare({"one": Candidate(lambda: sum(range(1000))), "ten": Candidate(lambda: sum(range(10_000)))}, 5, 0.01)
    assert 5.0 < cost["ten"] / cost["one"] < 20.0


def test_the_exponent_of_a_power_is_found() -> None:
    sizes = [2, 4, 8, 16]
    assert exponent(sizes, [3.0 * size**2.5 for size in sizes]) == pytest.approx(2.5)


def test_models_of_the_bench_have_two_outputs() -> None:
    assert all(isinstance(stable_model(n), LSUModel) and stable_model(n).output_count == 2 for n in FULL.sizes)
