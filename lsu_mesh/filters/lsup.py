"""LSUP: recursive estimation with a parallelotope as support."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.compiled import CompiledFilter, Ties, ties_option
from lsu_mesh.filters.filter import Guarantee
from lsu_mesh.filters.point_rule import PointOption
from lsu_mesh.kernels import filter_step
from lsu_mesh.kernels.parallelotopes import parallelotope
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support

TimeUpdate = Literal["image", "cgz", "edges", "strips"]

TIME_UPDATES: dict[str, int] = {
    "image": parallelotope.IMAGE,
    "cgz": parallelotope.CGZ,
    "edges": parallelotope.EDGES,
    "strips": parallelotope.STRIPS,
}
MAX_EXHAUSTIVE_SIZE = 6
"""States up to which ``time_update="edges"`` tries all combinations of edges."""
ROUNDING = 1e-12
"""Share of a bound's size by which a new hull may exceed it and still count as not wider."""


class LSUP(CompiledFilter):
    """Parallelotope filter: strips of the data (Vicino, Zappa), and a parallelotope around ``A P + B u + N box(rho)``.

    Parameters
    ----------
    model:
        The system; n states, m outputs.
    prior:
        A set, or a pair (lower, upper), that holds x_1: a parallelotope or a box is used as it is, of other sets the
        interval hull.
    time_update:
        ``"image"``: edges along A T, which reproduces the papers; ``"cgz"``: noise generators take the place of edges,
        one at a time, where that leaves less volume; ``"edges"``: the best n of all edges, n ≤ 6 (as ``"cgz"`` at a
        step whose unknown inputs leave more than 924 choices); ``"strips"``: the image, then the faces of the
        circumscribed box as strips.
    box:
        Whether a box is carried beside the parallelotope, by interval arithmetic over data and time updates and met
        with each hull; :meth:`bounds` are then that box, and :attr:`point` the centre moved into it. They never forget
        what was once known of a constant. The parallelotope takes nothing from the box.
    ties:
        A strip of data that cuts one face only leaves two parallelotopes of equal volume: ``"old"`` keeps the old
        edges, ``"new"`` takes the strip.
    point:
        The point estimate: ``"mean"``: of the truncated density beside the set, moved into it and into the box;
        ``"nearest"``: the point of both that is nearest to the parallelotope's centre; ``"centre"``: that centre
        (eq. 35), moved into the box, which may then lie outside of the parallelotope.

    Raises ``ModelError`` on options or a prior that do not fit.

    A strip never makes the volume larger, but it may make the interval hull larger: the new edges can leave the old
    set. The box beside it never follows; where the set itself should not either, use LSUPB. A flat set stays as thin
    as rounding allows, not thinner: its volume is tiny, not 0.

    Source: Lainová et al. 2019, section 3.2; Vicino & Zappa 1996; Chisci, Garulli & Zappa 1996.
    """

    kind: ClassVar[str] = "LSUP"
    guarantee: ClassVar[Guarantee] = "declared"
    algorithm: ClassVar[int] = 3
    family: ClassVar[int] = filter_step.PARALLELOTOPE

    def __init__(
        self,
        model: LSUModel,
        prior: Support | tuple[ArrayLike, ArrayLike],
        time_update: TimeUpdate = "image",
        box: bool = True,
        ties: Ties = "old",
        point: PointOption = "mean",
    ) -> None:
        if time_update not in TIME_UPDATES:
            raise ModelError(f"time_update must be one of {', '.join(TIME_UPDATES)}, not {time_update!r}")
        n, q = model.state_count, model.rho.size
        if time_update == "edges" and max(n, q) > MAX_EXHAUSTIVE_SIZE:
            raise ModelError(
                f'time_update="edges" tries all combinations of edges, up to {MAX_EXHAUSTIVE_SIZE} states and noises; '
                f'the model has {n} and {q}: use "cgz" or "strips"'
            )
        self.has_box = bool(box)
        super().__init__(model, prior, option=TIME_UPDATES[time_update] | ties_option(ties), point=point)
        self.ties = ties
        self.time_update = time_update

    def _condition(self, support: Support) -> float:
        """Bayesian transfer that never widens :meth:`bounds`, but for rounding; the gain is that of the parallelotopes.

        A strip that takes the place of an own one can push the hull out. Where that happens the edges keep their
        directions and are shortened to what the intersection reaches along them, by verified linear programs.
        """
        before, hull, volume = self._state, self._hull(self._state), self._log_volume(self._state)
        gain = super()._condition(support)
        if not self._widens(self._state, hull):
            return gain
        box, self._state = self._state[len(hull[0]) + 1 :], before
        shortened = self._shortened(support)
        if shortened is None or self._widens(shortened, hull):
            self._state = self._beside(before, box)
            return 0.0
        self._state = self._beside(shortened, box)
        return max(0.0, volume - self._log_volume(shortened)) if volume > -np.inf else 0.0

    def _continued(self, support: Support, lower: Vector, upper: Vector) -> Matrix:
        """The parallelotope, and the box where one is carried, bit by bit."""
        body = self._enclose(support)
        return np.vstack([body, lower, upper]) if self.has_box else body

    def _start(self, support: Support) -> Matrix:
        body = self._enclose(support)
        return np.vstack([body, *support.bounds()]) if self.has_box else body

    def _hull(self, state: Matrix) -> tuple[Vector, Vector]:
        """Interval hull of the parallelotope alone."""
        _, lower, upper, _ = self._describe(state[: self._model.state_count + 1])
        return lower, upper

    def _beside(self, state: Matrix, box: Matrix) -> Matrix:
        """The parallelotope of a state, and this box (2, n), met with its hull, or none (0, n), beside it."""
        body = state[: state.shape[1] + 1]
        if not len(box):
            return body
        lower, upper = self._hull(body)
        lower, upper = np.maximum(lower, box[0]), np.minimum(upper, box[1])
        if (lower > upper).any():
            raise InconsistentData("the set of LSUP and the transferred set have no point in common")
        return np.vstack([body, lower, upper])

    def _widens(self, state: Matrix, hull: tuple[Vector, Vector]) -> bool:
        """Whether the hull of a state exceeds another one by more than rounding."""
        lower, upper = self._hull(state)
        rounding = ROUNDING * np.maximum(np.abs(hull[0]), np.abs(hull[1]))
        return bool((lower < hull[0] - rounding).any() or (upper > hull[1] + rounding).any())

    def _shortened(self, support: Support) -> Matrix | None:
        """The state with edges as long as its intersection with ``support`` is along them; ``None`` for a flat one."""
        body = self._make_support(self._state)
        joint = body.to_constrained_zonotope().intersect(support)
        if joint.is_empty():
            raise InconsistentData("the set of LSUP and the transferred set have no point in common")
        strips = body.strips()
        if strips is None:
            return None
        low, high = joint.ranges(strips[0])
        middle = 0.5 * low + 0.5 * high
        radius = np.nextafter(np.maximum(high - middle, middle - low), np.inf)
        state, status = self._cut(self._state, strips[0], middle, radius)
        return state if status == 0 else None

    @staticmethod
    def _enclose(support: Support) -> Matrix:
        body = support if isinstance(support, Parallelotope) else support.interval_hull().to_parallelotope()
        return np.vstack([body.center, body.generators])

    @staticmethod
    def _make_support(state: Matrix) -> Parallelotope:
        return Parallelotope.trusted(state[0], state[1 : state.shape[1] + 1])
