"""Maximum a posteriori estimation on a sliding window: states, noise half-widths and unknown entries of matrices."""

from __future__ import annotations

from typing import ClassVar, Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Counts, Matrix, Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.filter import Filter, GainOf, Guarantee, OutputPrediction
from lsu_mesh.filters.point_rule import PointOption, PointRule, point_rule
from lsu_mesh.filters.transfer_gain import conditioned, hull_gain
from lsu_mesh.filters.validation import checked_prior, input_interval, output_vector, same_states
from lsu_mesh.filters.window.interval_estimate import interval_estimate
from lsu_mesh.filters.window.program import HalfWidths, Selected, WindowData, WindowProgram, WindowSolution
from lsu_mesh.filters.window.state import Window
from lsu_mesh.filters.window.structure import (
    Structure,
    UnknownEntries,
    are_equal,
    check_window_model,
    domain_bounds,
    input_matrix,
    noise_widths,
)
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

REWEIGHTINGS = 4
"""How often the weights of ``objective="log"`` are made anew."""
MIN_SHARE = 1e-3
"""A half-width below this share of the largest weighs no more than one of this share."""


class WindowMAP(Filter):
    """The most probable states, half-widths and parameters given the last Δ + 1 outputs, by linear programming.

    It needs no rho and no r: it estimates them. Its intervals are *no* guaranteed bounds.

    Parameters
    ----------
    model, prior:
        A, B, C, noise map and domain of an LSU model with n states (its rho and r are not used); a set, or a pair
        (lower, upper), that holds x_1.
    window:
        Δ: the window spans Δ + 2 states and Δ + 1 outputs.
    E, F, unknown:
        Correlated noise and unknown entries, see :class:`~lsu_mesh.filters.window.structure.Structure`.
    kappa, handover:
        κ of the published interval estimates, and of the interval to which the state that leaves is confined.
    objective:
        ``"sum"``: Σ rho + Σ r, eq. (21). ``"log"``: Σ ln rho + Σ ln r, eq. (20), by reweighting; it can drive a
        half-width to 0.
    point:
        ``"mean"``, ``"nearest"`` or ``"centre"``: a centred point of the optimal face. ``"vertex"``: a vertex, by
        HiGHS's simplex method. Either lies in the published interval.
    rho_range, r_range:
        Pairs (lower, upper) of limits of the half-widths, each a number or one per entry; equal ones fix a half-width.

    Raises
    ------
    ModelError
        Names the option that is wrong.

    Source: Pavelková & Kárný 2006 and 2014. The optimum is a face, not a point: two solvers agree in the objective
    only, and a centred point has about a quarter less error than a vertex.
    """

    kind: ClassVar[str] = "WindowMAP"
    guarantee: ClassVar[Guarantee] = "none"
    _state: Window

    def __init__(
        self,
        model: LSUModel,
        prior: Support | tuple[ArrayLike, ArrayLike],
        window: int = 25,
        E: ArrayLike | None = None,
        F: ArrayLike | None = None,
        unknown: UnknownEntries = (),
        kappa: float = 1.0,
        handover: float = 1.0,
        objective: Literal["sum", "log"] = "sum",
        point: PointOption | Literal["vertex"] = "mean",
        rho_range: tuple[ArrayLike, ArrayLike] = (0.0, np.inf),
        r_range: tuple[ArrayLike, ArrayLike] = (0.0, np.inf),
    ) -> None:
        if window < 1:
            raise ModelError(f"window must be at least 1, it is {window}")
        if objective not in ("sum", "log"):
            raise ModelError(f'objective must be "sum" or "log", it is {objective!r}')
        if point not in (*get_args(PointOption), "vertex"):
            raise ModelError(f'point must be "mean", "nearest", "centre" or "vertex", it is {point!r}')
        for name, value in (("kappa", kappa), ("handover", handover)):
            if not (np.isfinite(value) and value > 0):
                raise ModelError(f"{name} must be a number > 0, it is {value}")
        self._structure = Structure(model, E, F, unknown)
        low, high = _ranges(rho_range, r_range, self._structure.noise_count, model.output_count)
        self._program = WindowProgram(self._structure, HalfWidths.separate(low, high, np.ones(low.size)))
        self._model, self._length = model, window
        self._kappa, self._handover, self._objective = kappa, handover, objective
        self._point: Selected = "vertex" if point == "vertex" else "centre"
        self._point_rule: PointRule = "nearest" if point == "vertex" else point_rule(point)
        self.reset(checked_prior(model, prior))

    @property
    def model(self) -> LSUModel:
        """The model in force when no step says otherwise."""
        return self._model

    @property
    def point(self) -> Vector:
        """Estimate (n,) of the state now."""
        return np.array(self._state.data.X[-1])

    @property
    def point_rule(self) -> PointRule:
        """The rule of :attr:`point`; a vertex is said to be ``"nearest"``: it lies in the interval."""
        return self._point_rule

    @property
    def rho(self) -> Vector:
        """Estimated half-widths (q,) of the process noise."""
        return np.array(self._state.rho)

    @property
    def r(self) -> Vector:
        """Estimated half-widths (m,) of the output noise."""
        return np.array(self._state.r)

    @property
    def half_widths(self) -> tuple[Vector, Vector]:
        """The estimates :attr:`rho`, :attr:`r`."""
        return self.rho, self.r

    @property
    def theta(self) -> Vector:
        """Estimates (t,) of the unknown entries, in their order."""
        return np.array(self._state.data.theta)

    @property
    def states(self) -> Matrix:
        """Estimates (N, n) of all states in the window, the oldest first."""
        return np.array(self._state.data.X)

    @property
    def solution(self) -> WindowSolution | None:
        """The last answer of the solver."""
        return self._state.solution

    def interval_estimates(self, kappa: float | None = None, met: bool = True) -> tuple[Matrix, Matrix]:
        """Intervals (N, n) of all states in the window, eqs (29)–(31); the oldest first, infinite where there is none.

        ``met``: whether they are met with the states' boxes.
        """
        state = self._state
        kappa = self._kappa if kappa is None else kappa
        lower, upper = interval_estimate(state.smallest, state.largest, state.counts, kappa)
        return _met(lower, upper, state.data.lower, state.data.upper) if met else (lower, upper)

    @property
    def support(self) -> Orthotope:
        """The box :meth:`bounds`."""
        return Orthotope(*self.bounds())

    def bounds(self) -> tuple[Vector, Vector]:
        """Interval (n,), (n,) around :attr:`point`, met with the domain; *not* guaranteed.

        It is as wide as the interval estimate (29) of the window's state that was estimated most often; before there
        is one, as what the prior and the estimated half-widths leave.
        """
        data = self._state.data
        x, reach = data.X[-1], self._state.reach
        lower, upper = _met(x - reach, x + reach, data.lower[-1], data.upper[-1])
        return np.minimum(lower, x), np.maximum(upper, x)

    def predict_output(self, u: ArrayLike | Orthotope | None = None, model: LSUModel | None = None) -> OutputPrediction:
        """``F⁻¹(C x ± r̂)`` over :meth:`bounds`; *not* guaranteed."""
        if model is not None:
            raise ModelError("WindowMAP cannot take the outputs of another model for a step; give it all rows of C")
        theta = self._state.data.theta
        inverse = np.linalg.inv(self._structure.at("F", theta))
        C = inverse @ self._structure.at("C", theta)
        lower, upper = self.bounds()
        middle = C @ (0.5 * (lower + upper))
        reach = np.abs(C) @ (0.5 * (upper - lower)) + np.abs(inverse) @ self._state.r
        return OutputPrediction(middle - reach, middle + reach, C @ self.point)

    def update(
        self,
        y: ArrayLike,
        r: ArrayLike | None = None,
        model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> Orthotope:
        """Data update: solve the window's program with y_k (m,), NaN where missing.

        Raises ``InconsistentData`` where no half-widths in their ranges explain the window.
        """
        if r is not None:
            raise ModelError("WindowMAP estimates r; limits for it are the option r_range")
        if model is not None:
            raise ModelError("WindowMAP cannot take the outputs of another model for a step; give it all rows of C")
        state = self._state
        Y = np.array(state.data.Y)
        Y[-1] = output_vector(y, self._model.output_count)
        data = state.data._replace(Y=Y)
        solution = self._solve(data)
        smallest = np.fmin(state.smallest, solution.X)
        largest = np.fmax(state.largest, solution.X)
        counts = state.counts + 1
        self._state = Window(
            data=data._replace(X=solution.X, theta=solution.theta),
            rho=solution.rho,
            r=solution.r,
            smallest=smallest,
            largest=largest,
            counts=counts,
            reach=self._reach(smallest, largest, counts, state.reach),
            solution=solution,
        )
        return self.support

    def _solve(self, data: WindowData) -> WindowSolution:
        solution = self._program.solve(data, self._point)
        if self._objective == "log":
            for _ in range(REWEIGHTINGS):
                widths = np.concatenate([solution.rho, solution.r])
                floor = MIN_SHARE * widths.max(initial=0.0)
                if floor == 0.0:
                    break
                solution = self._program.solve(data, self._point, floor / np.maximum(widths, floor))
        return solution

    def _reach(self, smallest: Matrix, largest: Matrix, counts: Counts, before: Vector) -> Vector:
        row = int(np.argmax(counts))
        lower, upper = interval_estimate(smallest[[row]], largest[[row]], counts[[row]], self._kappa)
        return 0.5 * (upper - lower)[0] if np.isfinite(upper).all() else before

    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> Orthotope:
        """Time update: a new state enters the window, and the oldest leaves a window that is full.

        The state that is the oldest then is confined to its interval estimate, met with its box.
        """
        if rho is not None:
            raise ModelError("WindowMAP estimates rho; limits for it are the option rho_range")
        used = self._step_model(model)
        center, spread = input_interval(u, used.input_count)
        grown = self._grown(self._state, used, center, spread)
        self._state = self._shortened(grown) if len(grown.counts) > self._length + 2 else grown
        return self.support

    def _step_model(self, model: LSUModel | None) -> LSUModel:
        used = same_states(self._model, model)
        check_window_model(used)
        if model is not None and any(entry.matrix in "AB" for entry in self._structure.entries):
            raise ModelError("a model of one step and unknown entries of A or B exclude each other")
        if not are_equal(used.noise_map, self._model.noise_map):
            raise ModelError("the model of a step must have the filter's noise map")
        return used

    def _grown(self, state: Window, used: LSUModel, center: Vector, spread: Vector) -> Window:
        data, theta = state.data, state.data.theta
        known = self._structure.known
        own_A, own_B = (known["A"], known["B"]) if used is self._model else (used.A, input_matrix(used))
        A = own_A + self._structure.unknown_part("A", theta)
        B = own_B + self._structure.unknown_part("B", theta)
        inverse = np.linalg.inv(self._structure.at("E", theta)).astype(np.float64)
        low, high = domain_bounds(self._model)
        x = np.clip(inverse @ (A @ data.X[-1] + B @ center), low, high)
        none = np.full((1, x.size), np.nan)
        noise = np.abs(noise_widths(self._model, inverse)) @ state.rho
        return Window(
            data=WindowData(
                Y=np.vstack([data.Y, np.full((1, data.Y.shape[1]), np.nan)]),
                U=np.vstack([data.U, center]),
                spread=np.vstack([data.spread, spread]),
                A=np.concatenate([data.A, own_A[None]]),
                B=np.concatenate([data.B, own_B[None]]),
                lower=np.vstack([data.lower, low]),
                upper=np.vstack([data.upper, high]),
                X=np.vstack([data.X, x]),
                theta=theta,
                is_uniform=data.is_uniform and used is self._model,
            ),
            rho=state.rho,
            r=state.r,
            smallest=np.vstack([state.smallest, none]),
            largest=np.vstack([state.largest, none]),
            counts=np.append(state.counts, 0),
            reach=np.abs(inverse @ A) @ state.reach + np.abs(inverse @ B) @ spread + noise,
            solution=state.solution,
        )

    def _shortened(self, state: Window) -> Window:
        data = state.data
        low, high = interval_estimate(
            state.smallest[[1]], state.largest[[1]], state.counts[[1]], self._handover
        )  # fmt: skip
        low, high = _met(low[0], high[0], data.lower[1], data.upper[1])
        lower, upper, Y = data.lower[1:].copy(), data.upper[1:].copy(), data.Y[1:].copy()
        lower[0], upper[0], Y[0] = low, high, np.nan
        return state._replace(
            data=data._replace(
                Y=Y, U=data.U[1:], spread=data.spread[1:], A=data.A[1:], B=data.B[1:], lower=lower, upper=upper,
                X=data.X[1:],
            ),
            smallest=state.smallest[1:], largest=state.largest[1:], counts=state.counts[1:],
        )  # fmt: skip

    def condition(self, support: Support, gain: GainOf | None = "support") -> float:
        """Bayesian transfer: keep ``self ∩ support``, or a set of this class that holds it; see :class:`Filter`."""
        return conditioned(self, support, gain, self._condition)

    def _condition(self, support: Support) -> float:
        """Meet the box of the newest state with that of ``support``; the gain is that of the published intervals.

        Raises ``InconsistentData`` where the boxes have no point in common.
        """
        lower, upper = checked_prior(self._model, support).bounds()
        before, data = self.bounds(), self._state.data
        low, high = np.maximum(data.lower[-1], lower), np.minimum(data.upper[-1], upper)
        if (low > high).any():
            raise InconsistentData("the box of WindowMAP and the transferred set have no point in common")
        boxes = data.lower.copy(), data.upper.copy()
        boxes[0][-1], boxes[1][-1] = low, high
        X = data.X.copy()
        X[-1] = np.clip(X[-1], low, high)
        self._state = self._state._replace(data=data._replace(lower=boxes[0], upper=boxes[1], X=X))
        return hull_gain(before, self.bounds())

    def reset(self, support: Support) -> None:
        """Forget everything but the parameters, and start from a set that holds the state now."""
        lower, upper = checked_prior(self._model, support).bounds()
        n, m = self._model.state_count, self._model.output_count
        p, q = self._model.input_count, self._structure.noise_count
        low, high = _met(lower, upper, *domain_bounds(self._model))
        middle = np.where(np.isfinite(low) & np.isfinite(high), 0.5 * (low + high), np.clip(0.0, low, high))
        none = np.full((1, n), np.nan)
        self._state = Window(
            data=WindowData(
                Y=np.full((1, m), np.nan),
                U=np.zeros((0, p)),
                spread=np.zeros((0, p)),
                A=np.zeros((0, n, n)),
                B=np.zeros((0, n, p)),
                lower=low[None],
                upper=high[None],
                X=middle[None],
                theta=self._structure.start,
                is_uniform=True,
            ),
            rho=np.zeros(q),
            r=np.zeros(m),
            smallest=none,
            largest=none,
            counts=np.zeros(1, dtype=np.int64),
            reach=0.5 * (high - low),
            solution=None,
        )

    def snapshot(self) -> object:
        """The window; none of its arrays is ever written again."""
        return self._state

    def restore(self, snapshot: object) -> None:
        """Return to a state taken by :meth:`snapshot`, bit by bit."""
        self._state = cast("Window", snapshot)


def _met(lower: Matrix, upper: Matrix, low: Matrix, high: Matrix) -> tuple[Matrix, Matrix]:
    """The intersection of boxes; where it is empty, the nearest face of the second."""
    lower, upper = np.clip(lower, low, high), np.clip(upper, low, high)
    return np.minimum(lower, upper), np.maximum(lower, upper)


def _ranges(
    rho_range: tuple[ArrayLike, ArrayLike], r_range: tuple[ArrayLike, ArrayLike], q: int, m: int
) -> tuple[Vector, Vector]:
    """Limits (q + m,) of all half-widths."""
    limits = []
    for name, given, size in (("rho_range", rho_range, q), ("r_range", r_range, m)):
        try:
            low, high = (np.broadcast_to(np.asarray(side, dtype=np.float64), (size,)) for side in given)
        except (TypeError, ValueError) as error:
            raise ModelError(f"{name} must be a pair (lower, upper), each a number or {size}: {error}") from error
        if not (np.isfinite(low).all() and (low >= 0).all() and (low <= high).all()):
            raise ModelError(f"{name} must hold 0 <= lower <= upper, it is {given}")
        limits.append((low, high))
    return np.concatenate([limits[0][0], limits[1][0]]), np.concatenate([limits[0][1], limits[1][1]])
