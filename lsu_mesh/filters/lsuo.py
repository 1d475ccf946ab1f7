"""LSUO: recursive estimation with a box (orthotope) as support."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.compiled import CompiledFilter, Ties, ties_option
from lsu_mesh.filters.filter import Guarantee
from lsu_mesh.filters.point_rule import PointOption
from lsu_mesh.kernels import filter_step
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support


class LSUO(CompiledFilter):
    """Box filter: ``c⁺ = A c + B u``, ``q⁺ = |A| q + |N| rho``; data strips, interval hull, meet with the prediction.

    Parameters
    ----------
    model:
        The system; n states, m outputs.
    prior:
        A set, or a pair (lower, upper), that holds x_1; its interval hull is used.
    meet:
        Meet the hull of the strip result with the prediction (the hull alone can exceed it); ``False`` reproduces
        the paper.
    hull:
        ``"strips"``: hull of the parallelotope that the strip updates leave; ``"lp"``: exact hull of box ∩ strips, by
        2n linear programs with verified bounds.
    ties:
        A strip that cuts one face only leaves two parallelotopes of equal volume: ``"old"`` keeps the old edges,
        ``"new"`` takes the strip, which is nearer to Table 1 of the paper.
    point:
        The point estimate: ``"mean"``: of the density beside the box, truncated at it; ``"nearest"`` and ``"centre"``:
        the centre of the box (eq. 14).

    Raises ``ModelError`` on options or a prior that do not fit.
    Source: Pavelková & Jirsa 2018, eqs. (8)–(14); Lainová et al. 2019, section 3.1.
    """

    kind: ClassVar[str] = "LSUO"
    guarantee: ClassVar[Guarantee] = "declared"
    algorithm: ClassVar[int] = 2
    family: ClassVar[int] = filter_step.BOX

    def __init__(
        self,
        model: LSUModel,
        prior: Support | tuple[ArrayLike, ArrayLike],
        meet: bool = True,
        hull: Literal["strips", "lp"] = "strips",
        ties: Ties = "old",
        point: PointOption = "mean",
    ) -> None:
        if hull not in ("strips", "lp"):
            raise ModelError(f'hull must be "strips" or "lp", not {hull!r}')
        super().__init__(model, prior, option=(filter_step.MEET if meet else 0) | ties_option(ties), point=point)
        self.ties = ties
        self.meet = bool(meet)
        self.hull = hull

    @property
    def has_compiled_loop(self) -> bool:
        return self.hull == "strips" and super().has_compiled_loop

    @staticmethod
    def _enclose(support: Support) -> Matrix:
        return np.array(support.bounds())

    @staticmethod
    def _make_support(state: Matrix) -> Orthotope:
        return Orthotope.trusted(state[0], state[1])

    def _condition(self, support: Support) -> float:
        """Bayesian transfer that never widens :meth:`bounds`, also where the data update may (``meet=False``)."""
        before, volume = self._state, self._log_volume(self._state)
        gain = super()._condition(support)
        if self.meet:
            return gain
        self._state = np.array([np.maximum(self._state[0], before[0]), np.minimum(self._state[1], before[1])])
        return max(0.0, volume - self._log_volume(self._state)) if volume > -np.inf else 0.0

    def _cut(self, state: Matrix, C: Matrix, y: Vector, r: Vector) -> tuple[Matrix, int]:
        new, status = super()._cut(state, C, y, r)
        if self.hull == "lp" and status == 0:
            self._tighten_by_programs(state, C, y, r=r, new=new)
            crossed = np.flatnonzero(new[0] > new[1])
            status = int(np.flatnonzero(~np.isnan(y))[-1]) + 1 if crossed.size else 0
        return new, status

    @staticmethod
    def _tighten_by_programs(state: Matrix, C: Matrix, y: Vector, r: Vector, new: Matrix) -> None:
        """Meet ``new`` with the verified hull of the box and all strips."""
        measured = ~np.isnan(y)
        if not measured.any():
            return
        prior = Orthotope.trusted(state[0], state[1]).to_constrained_zonotope()
        lower, upper = prior.meet_strips(C[measured], y[measured], r[measured]).bounds()
        np.maximum(new[0], lower, out=new[0])
        np.minimum(new[1], upper, out=new[1])
