"""LSUPB: a parallelotope and a box that tighten each other."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.compiled import CompiledFilter
from lsu_mesh.filters.filter import Guarantee
from lsu_mesh.filters.point_rule import PointOption
from lsu_mesh.kernels import filter_step
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support


class LSUPB(CompiledFilter):
    """Bundle filter: a parallelotope and a box, both of which hold the state; the recommended default.

    Data strips go to both; the faces of the box are offered to the parallelotope as strips, the box is met with the
    hull of the parallelotope and with its faces. :attr:`support` is the intersection of both, :meth:`bounds` the box,
    and :meth:`volume` the smaller of both volumes, an upper bound of the intersection's.

    Parameters
    ----------
    model:
        The system; n states, m outputs.
    prior:
        A set, or a pair (lower, upper), that holds x_1. A parallelotope (or an intersection with one as a part) is
        used as it is, with its interval hull as the box; of other sets the interval hull.
    point:
        The point estimate: ``"mean"``: of the truncated density beside the set, moved into both bodies; ``"nearest"``:
        the point of both that is nearest to the box's centre; ``"centre"``: that centre, which may lie outside.

    It cures the two faults of a parallelotope alone, elongation over time and a hull wider than the data allow. The
    parallelotope is that of Lainová et al. 2019, section 3.2; the bundle is this library's own.
    """

    kind: ClassVar[str] = "LSUPB"
    guarantee: ClassVar[Guarantee] = "declared"
    algorithm: ClassVar[int] = 2
    family: ClassVar[int] = filter_step.BUNDLE

    def __init__(
        self, model: LSUModel, prior: Support | tuple[ArrayLike, ArrayLike], point: PointOption = "mean"
    ) -> None:
        super().__init__(model, prior, option=0, point=point)

    def _continued(self, support: Support, lower: Vector, upper: Vector) -> Matrix:
        """The parallelotope in ``support`` and the box, bit by bit."""
        body = next((part for part in getattr(support, "parts", ()) if isinstance(part, Parallelotope)), None)
        if body is None:
            raise ModelError(f"{self.kind} continues from an intersection with a parallelotope, not from {support!r}")
        return np.vstack([body.center, body.generators, lower, upper])

    @staticmethod
    def _enclose(support: Support) -> Matrix:
        hull = support.interval_hull()
        parts = (support, *getattr(support, "parts", ()))
        body = next((part for part in parts if isinstance(part, Parallelotope)), None) or hull.to_parallelotope()
        return np.vstack([body.center, body.generators, hull.lower, hull.upper])

    @staticmethod
    def _make_support(state: Matrix) -> Intersection:
        n = state.shape[1]
        return Intersection(
            [
                Parallelotope.trusted(state[0], state[1 : n + 1]),
                Orthotope.trusted(state[n + 1], state[n + 2]),
            ]
        )
