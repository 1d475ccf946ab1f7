"""LSUO: recursive estimation with a box (orthotope) as support."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.arguments import KernelModel
from lsu_mesh.filters.compiled import CompiledFilter, State
from lsu_mesh.filters.filter import OutputPrediction
from lsu_mesh.kernels import box
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class LSUO(CompiledFilter):
    """Box filter: ``c⁺ = A c + B u``, ``q⁺ = |A| q + |N| rho``; strips of the data, interval hull, meet with the prediction.

    Parameters
    ----------
    model:
        The system; n states, m outputs.
    prior:
        A set that holds x_1; its interval hull is used.
    meet:
        Meet the hull of the strip result with the prediction (the hull alone can exceed it); ``False`` reproduces the paper.
    hull:
        ``"strips"``: hull of the parallelotope that the strip updates leave; ``"lp"``: exact hull of box ∩ strips, by
        2n linear programs with verified bounds.

    Source: Pavelková & Jirsa 2018, eqs. (8)–(14); Lainová et al. 2019, section 3.1.
    """

    kind: ClassVar[str] = "LSUO"

    def __init__(
        self, model: LSUModel, prior: Support, meet: bool = True, hull: Literal["strips", "lp"] = "strips"
    ) -> None:
        if hull not in ("strips", "lp"):
            raise ModelError(f'hull must be "strips" or "lp", not {hull!r}')
        self.meet = bool(meet)
        self.hull = hull
        super().__init__(model, prior)

    @property
    def point(self) -> Vector:
        """The centre of the box (eq. 14)."""
        return 0.5 * self._state[0] + 0.5 * self._state[1]

    def _scratch(self) -> Matrix:
        return box.scratch(self._model.state_count)

    def _enclose(self, support: Support) -> State:
        lower, upper = support.bounds()
        return np.array(lower), np.array(upper)

    def _make_support(self, state: State) -> Orthotope:
        return Orthotope.trusted(*state)

    def _update(self, state: State, C: Matrix, y: Vector, r: Vector) -> tuple[State, int]:
        lower, upper = np.empty_like(state[0]), np.empty_like(state[0])
        status = box.update(*state, C, y, r, self.meet, lower, upper, self._work)
        return (lower, upper), status

    def _predict(self, state: State, arrays: KernelModel, u: Vector, widths: Vector) -> tuple[State, int]:
        lower, upper = np.empty_like(state[0]), np.empty_like(state[0])
        status = box.predict(*state, arrays.A, arrays.B, u, arrays.G, widths, lower, upper, self._work)
        return (lower, upper), status

    def _meet_box(self, state: State, lower: Vector, upper: Vector) -> tuple[State, int]:
        new_lower, new_upper = np.empty_like(lower), np.empty_like(upper)
        status = box.meet_box(*state, lower, upper, new_lower, new_upper)
        return (new_lower, new_upper), status

    def _predict_output(self, state: State, r: Vector) -> OutputPrediction:
        m = r.size
        prediction = OutputPrediction(np.empty(m), np.empty(m), np.empty(m))
        box.predict_output(*state, self._arrays.C, r, *prediction)
        return prediction
