"""The window's program against HiGHS, against differences, and against its own promises."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.optimize import linprog

from lsu_mesh.array_types import Array
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.window.batch_map import batch_map, record
from lsu_mesh.filters.window.highs import inequalities
from lsu_mesh.filters.window.program import HalfWidths, WindowData, WindowProgram
from lsu_mesh.filters.window.structure import Structure, Unknown
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

E = np.array([[1.0, 0.5, 0.25], [0.0, 1.0, 0.3], [0.0, 0.0, 1.0]])
F = np.array([[1.0, 0.4], [0.0, 1.0]])
EVERY = tuple(
    Unknown(*entry, -2.0, 2.0)
    for entry in [("A", 1, 2), ("A", 3, 3), ("B", 2, 1), ("C", 1, 3), ("E", 1, 2), ("E", 2, 3), ("F", 1, 2)]
)


class Case(NamedTuple):
    structure: Structure
    data: WindowData


def plant(rng: np.random.Generator, **options: Any) -> LSUModel:
    """A stable model with 3 states, 2 inputs, 2 outputs."""
    A = rng.normal(size=(3, 3))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    return LSUModel(A, rng.normal(size=(3, 2)), rng.normal(size=(2, 3)), 0.1, 0.3, **options)


def case(seed: int, N: int = 12, missing: float = 0.2, structure: Structure | None = None) -> Case:
    """Data of a random model over N states."""
    rng = np.random.default_rng(seed)
    structure = structure or Structure(plant(rng))
    model = structure.model
    noise = model.rho.size
    X, U = np.zeros((N, 3)), rng.normal(size=(N - 1, 2))
    assert model.B is not None
    for k in range(N - 1):
        w = rng.uniform(-0.1, 0.1, noise)
        X[k + 1] = model.A @ X[k] + model.B @ U[k] + (w if model.noise_map is None else model.noise_map @ w)
    Y = X @ model.C.T + rng.uniform(-0.3, 0.3, (N, 2))
    Y[rng.random(Y.shape) < missing] = np.nan
    known = structure.known
    free = np.full((N, 3), np.inf)
    theta = np.clip(structure.start + rng.normal(size=structure.start.size), structure.lower, structure.upper)
    return Case(
        structure,
        WindowData(
            Y, U, np.zeros((N - 1, 2)), np.tile(known["A"], (N - 1, 1, 1)), np.tile(known["B"], (N - 1, 1, 1)),
            -free, free, X + rng.normal(size=X.shape) * 0.1, theta, True,
        ),
    )  # fmt: skip


def separate(structure: Structure, upper: float = np.inf) -> HalfWidths:
    size = structure.noise_count + structure.model.output_count
    return HalfWidths.separate(np.zeros(size), np.full(size, upper), np.ones(size))


def residuals(structure: Structure, data: WindowData, X: Array, theta: Array) -> tuple[Array, Array]:
    """``T (E x⁺ − A x − B u)`` (N − 1, n) and ``F y − C x`` (N, m), products of unknowns and all, written down anew."""
    A, B, C, E, F = (structure.at(name, theta) for name in ("A", "B", "C", "E", "F"))
    rest = X[1:] @ E.T - X[:-1] @ A.T - data.U @ B.T
    return rest @ structure.transform.T, np.nan_to_num(data.Y) @ F.T - X @ C.T


def objective_by_highs(case: Case, extra: dict[str, Any] | None = None) -> float:
    """The smallest Σ rho + Σ r for known matrices, by dense rows that are made from unit vectors."""
    structure, data = case
    N, n = data.X.shape
    count, widths = N * n, structure.noise_count + 2
    zero = np.concatenate([part.ravel() for part in residuals(structure, data, np.zeros((N, n)), data.theta)])
    columns = []
    for unit in np.eye(count):
        parts = residuals(structure, data, unit.reshape(N, n), data.theta)
        columns.append(np.concatenate([part.ravel() for part in parts]) - zero)
    M = np.array(columns).T
    uses = structure.at("F", data.theta) != 0
    used = np.concatenate([np.ones((N - 1) * n, bool), ~(np.isnan(data.Y) @ uses.T).ravel()])
    which = np.concatenate([np.tile(np.arange(n), N - 1), structure.noise_count + np.tile(np.arange(2), N)])
    is_equation = np.concatenate([np.tile(np.arange(n) >= structure.noise_count, N - 1), np.zeros(2 * N, bool)])
    W = np.eye(widths)[np.where(is_equation, 0, which)]
    rows = used & ~is_equation
    A_ub = np.block([[M[rows], -W[rows]], [-M[rows], -W[rows]]])
    b_ub = np.concatenate([-zero[rows], zero[rows]])
    equations = {}
    if is_equation.any():
        equations = {
            "A_eq": np.hstack([M[is_equation], np.zeros((is_equation.sum(), widths))]),
            "b_eq": -zero[is_equation],
        }
    limits = [*zip(data.lower.ravel(), data.upper.ravel(), strict=True)] + [(0, np.inf)] * widths
    cost = np.concatenate([np.zeros(count), np.ones(widths)])
    answer = linprog(cost, A_ub=A_ub, b_ub=b_ub, bounds=limits, **equations, **(extra or {}))
    assert answer.status == 0
    return float(answer.fun)


@pytest.mark.parametrize("seed", range(12))
def test_the_objective_is_that_of_highs_and_every_row_holds(seed: int) -> None:
    structure, data = case(seed, N=int(np.random.default_rng(seed).integers(2, 30)), missing=0.1 * (seed % 6))
    solution = WindowProgram(structure, separate(structure)).solve(data)
    assert solution.solver == "interior-point"
    assert solution.objective == pytest.approx(objective_by_highs(Case(structure, data)), abs=1e-7)
    process, output = residuals(structure, data, solution.X, data.theta)
    assert (np.abs(process) <= solution.rho + 1e-12).all()
    output[np.isnan(data.Y)] = 0.0
    assert (np.abs(output) <= solution.r + 1e-12).all()
    assert solution.objective - solution.bound <= 1e-7


def test_boxes_of_the_states_hold() -> None:
    structure, data = case(3, N=20)
    tight = data._replace(lower=np.full((20, 3), -0.2), upper=np.full((20, 3), 0.3))
    solution = WindowProgram(structure, separate(structure)).solve(tight)
    np.testing.assert_array_equal(solution.X, np.clip(solution.X, tight.lower, tight.upper))
    assert solution.objective == pytest.approx(objective_by_highs(Case(structure, tight)), abs=1e-7)


def test_known_correlations_take_part() -> None:
    """E and F of the paper; with a missing y_2 the row of y_1, which uses it, is dropped too."""
    rng = np.random.default_rng(5)
    structure = Structure(plant(rng), E, F)
    _, data = case(5, N=15, missing=0.0, structure=structure)
    Y = data.Y.copy()
    Y[4, 1] = np.nan
    data = data._replace(Y=Y)
    program = WindowProgram(structure, separate(structure))
    rows = program.rows(data)
    outputs = rows.span[14 * 3 :].reshape(15, 2)
    assert outputs[4].tolist() == [0, 0]
    assert outputs[5].tolist() == [3, 3]
    assert program.solve(data).objective == pytest.approx(objective_by_highs(Case(structure, data)), abs=1e-7)


@pytest.mark.parametrize("noise_map", [[[0.5], [1.0], [0.2]], [[1.0, 0.3], [0.0, 1.0], [0.4, 0.1]]])
def test_a_noise_map_with_fewer_columns_leaves_equations(noise_map: list[list[float]]) -> None:
    rng = np.random.default_rng(8)
    structure = Structure(plant(rng, noise_map=noise_map).replace(rho=0.1))
    _, data = case(8, N=18, structure=structure)
    solution = WindowProgram(structure, separate(structure)).solve(data)
    assert solution.objective == pytest.approx(objective_by_highs(Case(structure, data)), abs=1e-7)
    process, _ = residuals(structure, data, solution.X, data.theta)
    q = len(noise_map[0])
    assert np.abs(process[:, q:]).max() <= 1e-7
    assert (np.abs(process[:, :q]) <= solution.rho + 1e-12).all()


def test_the_rows_are_the_derivative_of_the_residuals() -> None:
    """With every kind of unknown entry; the residuals are bilinear, so that central differences are exact."""
    structure = Structure(plant(np.random.default_rng(1)), E, F, EVERY)
    _, data = case(1, N=9, missing=0.0, structure=structure)
    rows = WindowProgram(structure, separate(structure)).rows(data)
    count, n = data.X.size, 3

    def true(z: Array) -> Array:
        parts = residuals(structure, data, z[:count].reshape(data.X.shape), z[count:])
        return np.concatenate([part.ravel() for part in parts])

    z = np.concatenate([data.X.ravel(), data.theta])
    numeric = np.array([(true(z + h) - true(z - h)) / 2.0 for h in np.eye(z.size)]).T
    linear = np.zeros_like(numeric)
    for r in range(rows.first.size):
        linear[r, rows.first[r] : rows.first[r] + rows.span[r]] = rows.a[r, : rows.span[r]]
        linear[r, count:] = rows.g[r]
    np.testing.assert_allclose(linear, numeric, atol=1e-9)
    np.testing.assert_allclose(linear @ z + rows.d, true(z), atol=1e-9)
    assert n * 8 + 2 * 9 == rows.first.size


def test_the_program_with_unknown_entries_is_solved_to_the_optimum() -> None:
    structure = Structure(plant(np.random.default_rng(2)), None, None, EVERY)
    _, data = case(2, N=25, structure=structure)
    program = WindowProgram(structure, separate(structure))
    solution = program.solve(data)
    vertex = program.solve(data, "vertex")
    assert (solution.solver, vertex.solver) == ("interior-point", "HiGHS")
    assert solution.objective == pytest.approx(vertex.objective, abs=1e-7)


def test_a_centred_point_is_not_a_vertex() -> None:
    """The optimum is a face: the objectives agree, the states do not; fewer rows are tight at the centre."""
    structure, data = case(4, N=27, missing=0.0)
    program = WindowProgram(structure, separate(structure))
    tight = []
    for point in ("centre", "vertex"):
        solution = program.solve(data, point)  # type: ignore[arg-type]
        process, output = residuals(structure, data, solution.X, data.theta)
        gaps = np.concatenate([(solution.rho - abs(process)).ravel(), (solution.r - abs(output)).ravel()])
        tight.append(int((gaps < 1e-6).sum()))
    assert tight[0] < tight[1]


def test_limits_that_cannot_be_kept_are_a_contradiction() -> None:
    structure, data = case(6, N=10, missing=0.0)
    with pytest.raises(InconsistentData, match="half-widths within their limits"):
        WindowProgram(structure, separate(structure, upper=1e-3)).solve(data)


def test_fixed_half_widths_stay() -> None:
    structure, data = case(6, N=10, missing=0.0)
    low, high = np.zeros(5), np.full(5, np.inf)
    low[0] = high[0] = 0.25
    widths = HalfWidths.separate(low, high, np.ones(5))
    assert WindowProgram(structure, widths).solve(data).rho[0] == 0.25


def test_a_common_factor_is_the_smallest_that_explains() -> None:
    structure, data = case(7, N=20, missing=0.0)
    shape = np.array([0.1, 0.1, 0.1, 0.3, 0.3])
    widths = HalfWidths.common_factor(shape)
    solution = WindowProgram(structure, widths).solve(data)
    np.testing.assert_allclose(np.concatenate([solution.rho, solution.r]), solution.objective * shape)
    for factor, can_be in ((1.001, True), (0.999, False)):
        exact = shape * solution.objective * factor
        fixed = HalfWidths.separate(exact, exact, np.ones(5))
        if can_be:
            WindowProgram(structure, fixed).solve(data)
        else:
            with pytest.raises(InconsistentData):
                WindowProgram(structure, fixed).solve(data)


def test_a_batch_finds_the_entries_that_made_the_data() -> None:
    rng = np.random.default_rng(3)
    true = LSUModel([[0.9, 0.2], [-0.3, 0.7]], [[1.0], [0.5]], [[1.0, 0.0]], 0.01, 0.02)
    X, U = np.zeros((300, 2)), rng.normal(size=(300, 1))
    assert true.B is not None
    for k in range(299):
        X[k + 1] = true.A @ X[k] + true.B @ U[k] + rng.uniform(-0.01, 0.01, 2)
    Y = X @ true.C.T + rng.uniform(-0.02, 0.02, (300, 1))
    wrong = true.replace(A=[[0.7, 0.2], [-0.3, 0.7]], B=[[1.0], [0.8]])
    structure = Structure(wrong, unknown=[["A", 1, 1, 0.0, 1.0], ["B", 2, 1, 0.0, 2.0]])
    answer = batch_map(structure, record(structure, Y, U), separate(structure), Orthotope([-1, -1], [1, 1]))
    np.testing.assert_allclose(answer.theta, [0.9, 0.5], atol=0.01)
    assert answer.objective <= 0.04


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        (["G", 1, 1, 0, 1], "there is no matrix 'G'"),
        (["A", 4, 1, 0, 1], "has no entry"),
        (["E", 2, 1, 0, 1], "above the diagonal"),
        (["A", 1, 1, 1, 0], "in order"),
        (["A", 1], "must be \\[matrix, row, column, lower, upper\\]"),
    ],
)
def test_a_wrong_entry_is_named(entry: list[Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        Structure(plant(np.random.default_rng(0)), unknown=[entry])


def test_e_must_be_unit_upper_triangular() -> None:
    with pytest.raises(ModelError, match="upper triangular with ones"):
        Structure(plant(np.random.default_rng(0)), E=np.eye(3) * 2)


@pytest.mark.soak
@pytest.mark.parametrize(("length", "least"), [(5, 15.0), (25, 3.0), (50, 2.0)])
def test_a_solution_costs_a_fraction_of_linprog(length: int, least: float) -> None:
    """The same program, both on one core in one run; the best of several rounds each."""
    ratios = []
    for seed in range(5):
        structure, data = case(seed, N=length + 2, missing=0.0)
        program = WindowProgram(structure, separate(structure))
        rows, limits = program.rows(data), program.limits(data)
        matrix, right, _ = inequalities(rows, limits, data.X.size)
        bounds = np.stack([limits.lower, limits.upper], axis=1)
        program.solve(data)
        own, other = [], []
        for _ in range(15):
            began = time.perf_counter()
            program.solve(data)
            own.append(time.perf_counter() - began)
            began = time.perf_counter()
            linprog(limits.cost, A_ub=matrix, b_ub=right, bounds=bounds, method="highs")
            other.append(time.perf_counter() - began)
        ratios.append(min(other) / min(own))
    print(f"window {length}: {np.median(ratios):.1f} times as fast as linprog")
    assert np.median(ratios) >= least
