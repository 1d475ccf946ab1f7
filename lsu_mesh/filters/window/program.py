"""The linear program of the window estimators: rows, limits, a verified answer.

Over the states x_1 … x_N of the window, unknown entries θ and half-widths rho, r (hats: latest estimates, k/u: known
and unknown part of a matrix)::

    minimise  Σ weight · half-width      subject to
    |Ê x_{t+1} − Â x_t + Σ θ_E x̂_{t+1,j} − Σ θ_A x̂_{t,j} − Σ θ_B u_j − (kB u + uÊ x̂_{t+1} − uÂ x̂_t)| <= rho
    |kF y_t + Σ θ_F y_j − Ĉ x_t − Σ θ_C x̂_{t,j} + uĈ x̂_t| <= r

Source: Pavelková & Kárný 2014, eqs (21)–(26) and Appendix A, signs and products as derived anew.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Stack, Vector
from lsu_mesh.errors import LsuMeshError
from lsu_mesh.filters.window.structure import Structure
from lsu_mesh.kernels.linear_programs.banded_program import Limits, Rows
from lsu_mesh.kernels.linear_programs.window_program import data_size, solve_window

Selected = Literal["centre", "vertex"]

ACCEPTED_GAP = 1e-7
"""Largest gap between objective and its lower bound, as a share of the objective."""
ACCEPTED_SHARE = 1e-8
"""… plus this share of the size of the data."""
MAX_SHARE = 1e-6
"""Where not, the better answer of both solvers counts if its gap is at most this share of the size of the data."""
ACCEPTED_VIOLATION = 1e-7
"""Largest violation of a row that has no half-width of its own, as a share of the data's scale."""
MAX_ITERATIONS = 60


class UnsolvedProgram(LsuMeshError):
    """No solver has found an answer that could be verified."""


class WindowData(NamedTuple):
    """What the rows are made of, for N states.

    Y (N, m), NaN where missing; U (N − 1, p) inputs from each state to the next; spread (N − 1, p) half-widths of
    inputs that are known to lie in an interval only; A (N − 1, n, n) and B (N − 1, n, p) of the transitions, 0 at
    unknown entries; lower, upper (N, n) boxes of the states; X (N, n), theta (t,) the latest estimates;
    ``is_uniform``: all transitions have the model's own A and B.
    """

    Y: Matrix
    U: Matrix
    spread: Matrix
    A: Stack
    B: Stack
    lower: Matrix
    upper: Matrix
    X: Matrix
    theta: Vector
    is_uniform: bool = False


class WindowSolution(NamedTuple):
    """States X (N, n), unknown entries theta (t,), half-widths rho (q,) and r (m,).

    ``objective``; ``bound``: it cannot be lower, for a program without linearised products; ``iterations``;
    ``solver``: ``"interior-point"`` or ``"HiGHS"``.
    """

    X: Matrix
    theta: Vector
    rho: Vector
    r: Vector
    objective: float
    bound: float
    iterations: int
    solver: str


class HalfWidths(NamedTuple):
    """The half-widths of the program: ``rho_i = factor_i · h[column_i]``, then r likewise.

    columns, factors (q + m,); lower, upper, cost (w,) of the columns h. Where the column is −1, the half-width is the
    factor itself; where that is 0 too, the row is an equation.
    """

    columns: NDArray[np.int64]
    factors: Vector
    lower: Vector
    upper: Vector
    cost: Vector

    @classmethod
    def separate(cls, lower: Vector, upper: Vector, weights: Vector) -> HalfWidths:
        """One unknown for each half-width, all (q + m,)."""
        return cls(columns=np.arange(lower.size), factors=np.ones(lower.size), lower=lower, upper=upper, cost=weights)

    @classmethod
    def common_factor(cls, shape: Vector, learns: NDArray[np.bool_] | None = None) -> HalfWidths:
        """One unknown factor of all half-widths that are learned; shape (q + m,), 0 where there is no noise.

        learns (q + m,): the others keep the half-width of ``shape``; ``None``: all are learned.
        """
        columns = np.where((shape > 0) & (True if learns is None else learns), 0, -1)
        return cls(columns=columns, factors=shape, lower=np.zeros(1), upper=np.full(1, np.inf), cost=np.ones(1))

    def values(self, h: Vector) -> Vector:
        """All half-widths (q + m,)."""
        if h.size == self.columns.size > 1:
            return h
        return np.where(self.columns >= 0, self.factors * h[np.maximum(self.columns, 0)], self.factors)


class WindowProgram:
    """Builds and solves the program; arrays of the rows are kept, and only what has changed is written again."""

    def __init__(self, structure: Structure, widths: HalfWidths) -> None:
        self.structure = structure
        self.widths = widths
        self._rows: dict[int, Rows] = {}
        self._uniform: dict[int, bool] = {}
        self._patterns = {name: structure.of(name) for name in ("A", "B", "C", "E", "F")}
        F = structure.at("F", structure.start)
        uses = F != 0.0
        for _, i, j in structure.of("F"):
            uses[i, j] = True
        self._uses = uses
        self._separate_outputs = np.array_equal(uses, np.eye(len(uses)))
        q, n = structure.noise_count, structure.model.state_count
        self._known_reach = np.concatenate([np.where(widths.columns[:q] < 0, widths.factors[:q], 0.0), np.zeros(n - q)])
        self._has_spread = False
        """Whether a window ever had inputs that were known to lie in an interval only."""
        self._minus_B = -(structure.transform @ structure.known["B"]).T

    def solve(self, data: WindowData, point: Selected = "centre", cost: Vector | None = None) -> WindowSolution:
        """The answer to the window's program; a centred point also where the simplex method ends without a vertex.

        Raises
        ------
        InconsistentData
            No half-widths within their limits explain the data.
        UnsolvedProgram
            Neither solver's answer passed the check.
        """
        rows = self.rows(data)
        limits = self.limits(data, cost)
        count = data.X.size
        start = np.zeros(limits.cost.size)
        start[:count], start[count : count + data.theta.size] = data.X.ravel(), data.theta
        if point == "centre":
            iterations, z, value, bound, violation, scale = solve_window(
                rows, limits, start, count, 2 * data.X.shape[1] - 1, MAX_ITERATIONS
            )
            if _is_accepted(value, bound, violation, scale=scale, share=ACCEPTED_SHARE):
                return self._solution(z, data, value, bound=bound, iterations=iterations, solver="interior-point")
        solution, share = self._by_highs(rows, limits, data, point)
        if point == "centre" and violation <= ACCEPTED_VIOLATION * scale and value - bound < share * scale:
            solution, share = (
                self._solution(z, data, value, bound=bound, iterations=iterations, solver="interior-point"),
                0.0,
            )
        if share > MAX_SHARE and point == "vertex":
            return self.solve(data, "centre", cost)
        if share > MAX_SHARE:
            raise UnsolvedProgram(
                f"the window's program was not solved: objective {solution.objective:.6g}, "
                f"lower bound {solution.bound:.6g}"
            )
        return solution

    def _by_highs(self, rows: Rows, limits: Limits, data: WindowData, point: Selected) -> tuple[WindowSolution, float]:
        """HiGHS's answer, and its gap as a share of the size of the data, infinite where rows do not hold."""
        from lsu_mesh.filters.window.highs import highs_answer

        count = data.X.size
        size = data_size(rows, data.X.ravel(), count)
        method = "highs-ds" if point == "vertex" else "highs"
        z, value, bound, violation, iterations = highs_answer(rows, limits, count, size=size, method=method)
        share = (value - bound) / size if violation <= ACCEPTED_VIOLATION * size else np.inf
        return self._solution(z, data, value, bound=bound, iterations=iterations, solver="HiGHS"), share

    def _solution(
        self, z: Vector, data: WindowData, value: float, bound: float, iterations: int, solver: str
    ) -> WindowSolution:
        count, coefficients = data.X.size, data.theta.size
        widths = self.widths.values(z[count + coefficients :])
        q = self.structure.noise_count
        return WindowSolution(
            X=z[:count].reshape(data.X.shape), theta=z[count : count + coefficients], rho=widths[:q], r=widths[q:],
            objective=value, bound=bound, iterations=iterations, solver=solver,
        )  # fmt: skip

    def limits(self, data: WindowData, cost: Vector | None = None) -> Limits:
        """Limits and cost of all unknowns."""
        structure, widths = self.structure, self.widths
        count, coefficients = data.X.size, structure.lower.size
        lower, upper, costs = np.empty((3, count + coefficients + widths.cost.size))
        lower[:count], upper[:count], costs[: count + coefficients] = data.lower.ravel(), data.upper.ravel(), 0.0
        if coefficients:
            lower[count : count + coefficients], upper[count : count + coefficients] = structure.lower, structure.upper
        lower[count + coefficients :], upper[count + coefficients :] = widths.lower, widths.upper
        costs[count + coefficients :] = widths.cost if cost is None else cost
        return Limits(lower, upper, costs)

    def rows(self, data: WindowData) -> Rows:
        """The rows: first those of all transitions, then those of all outputs; overwritten by the next call."""
        N, n = data.X.shape
        rows = self._rows.get(N)
        is_written = self._uniform.get(N, False)
        if rows is None:
            rows = self._rows[N] = self._empty(N)
        self._uniform[N] = data.is_uniform
        states = (N - 1) * n
        a, g, d = rows.a, rows.g, rows.d
        self._write_transitions(
            data,
            a[:states].reshape(N - 1, n, 2 * n),
            g[:states],
            d=d[:states],
            reach=rows.reach[:states],
            is_written=is_written,
        )
        self._write_outputs(
            data, a[states:, :n], g[states:], d=d[states:], span=rows.span[states:], is_written=is_written
        )
        return rows

    def _empty(self, N: int) -> Rows:
        n, m, t = self.structure.model.state_count, self.structure.model.output_count, len(self.structure.entries)
        q, widths = self.structure.noise_count, self.widths
        states, outputs = (N - 1) * n, N * m
        columns = np.concatenate([widths.columns[:q], np.full(n - q, -1)]), widths.columns[q:]
        factors = np.concatenate([widths.factors[:q], np.zeros(n - q)]), widths.factors[q:]
        known = [np.where(column < 0, factor, 0.0) for column, factor in zip(columns, factors, strict=True)]
        return Rows(
            first=np.concatenate([np.repeat(np.arange(N - 1) * n, n), np.repeat(np.arange(N) * n, m)]),
            span=np.concatenate([np.full(states, 2 * n), np.full(outputs, n)]),
            a=np.zeros((states + outputs, 2 * n)),
            g=np.zeros((states + outputs, t)),
            d=np.zeros(states + outputs),
            width=np.concatenate([np.tile(columns[0], N - 1), np.tile(columns[1], N)]),
            factor=np.concatenate([np.tile(factors[0], N - 1), np.tile(factors[1], N)]),
            reach=np.concatenate([np.tile(known[0], N - 1), np.tile(known[1], N)]),
        )

    def _write_transitions(
        self, data: WindowData, a: Stack, g: Matrix, d: Vector, reach: Vector, is_written: bool
    ) -> None:
        structure, n = self.structure, data.X.shape[1]
        P = structure.transform
        before, after = data.X[:-1], data.X[1:]
        if structure.has_unknown or not data.is_uniform or not is_written:
            a[:, :, :n] = -(P @ (data.A + structure.unknown_part("A", data.theta)))
            a[:, :, n:] = P if structure.model.noise_map is not None else structure.at("E", data.theta)
        uniform = data.is_uniform
        constant = data.U @ self._minus_B if uniform else -(data.B @ data.U[:, :, None])[:, :, 0] @ P.T
        if self._patterns["E"]:
            constant -= after @ structure.unknown_part("E", data.theta).T
        if self._patterns["A"]:
            constant += before @ structure.unknown_part("A", data.theta).T @ P.T
        d[:] = constant.ravel()
        if data.spread.any() or self._has_spread:
            self._has_spread = True
            reach[:] = np.tile(self._known_reach, len(before)) + (np.abs(P @ data.B) @ data.spread[:, :, None]).ravel()
        if not structure.has_unknown:
            return
        block = g.reshape(len(before), n, len(structure.entries))
        block[:] = 0.0
        for k, i, j in self._patterns["E"]:
            block[:, i, k] = after[:, j]
        for k, i, j in self._patterns["A"]:
            block[:, :, k] = -before[:, j, None] * P[:, i]
        for k, i, j in self._patterns["B"]:
            block[:, :, k] = -data.U[:, j, None] * P[:, i]

    def _write_outputs(
        self, data: WindowData, a: Matrix, g: Matrix, d: Vector, span: NDArray[np.int64], is_written: bool
    ) -> None:
        structure = self.structure
        N, n = data.X.shape
        missing = np.isnan(data.Y)
        Y = np.where(missing, 0.0, data.Y)
        if structure.has_unknown or not is_written:
            a.reshape(N, -1, n)[:] = -structure.at("C", data.theta)
        constant = Y if self._separate_outputs else Y @ structure.known["F"].T
        if self._patterns["C"]:
            constant = constant + data.X @ structure.unknown_part("C", data.theta).T
        d[:] = constant.ravel()
        span[:] = np.where(missing if self._separate_outputs else missing @ self._uses.T, 0, n).ravel()
        if not structure.has_unknown:
            return
        block = g.reshape(N, Y.shape[1], len(structure.entries))
        block[:] = 0.0
        for k, i, j in self._patterns["F"]:
            block[:, i, k] = Y[:, j]
        for k, i, j in self._patterns["C"]:
            block[:, i, k] = -data.X[:, j]


def _is_accepted(value: float, bound: float, violation: float, scale: float, share: float) -> bool:
    """Whether objective and lower bound meet, and rows hold; ``scale``: the size of the data."""
    close = value - bound <= ACCEPTED_GAP * abs(value) + share * scale
    return bool(close and violation <= ACCEPTED_VIOLATION * scale)
