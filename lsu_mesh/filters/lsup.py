"""LSUP: recursive estimation with a parallelotope as support."""

from __future__ import annotations

from typing import ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.arguments import KernelModel
from lsu_mesh.filters.compiled import CompiledFilter, State
from lsu_mesh.filters.filter import OutputPrediction
from lsu_mesh.kernels import parallelotope
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
TimeUpdate = Literal["image", "cgz", "edges", "strips"]


class LSUP(CompiledFilter):
    """Parallelotope filter: strips of the data (Vicino, Zappa), and a parallelotope around ``A P + B u + N box(rho)``.

    Parameters
    ----------
    model:
        The system; n states, m outputs.
    prior:
        A set that holds x_1: a parallelotope or a box is used as it is, of other sets the interval hull.
    time_update:
        ``"image"``: edges along A T (reproduces the papers).

    Source: Lainová et al. 2019, section 3.2; Vicino & Zappa 1996; Chisci, Garulli & Zappa 1996.
    """

    kind: ClassVar[str] = "LSUP"

    def __init__(self, model: LSUModel, prior: Support, time_update: TimeUpdate = "image") -> None:
        if time_update not in get_args(TimeUpdate):
            raise ModelError(f"time_update must be one of {', '.join(get_args(TimeUpdate))}, not {time_update!r}")
        self.time_update = time_update
        super().__init__(model, prior)

    @property
    def point(self) -> Vector:
        """The centre of the parallelotope (eq. 35)."""
        return self._state[0].copy()

    def _scratch(self) -> Matrix:
        return parallelotope.scratch(self._model.state_count, self._arrays.G.shape[1])

    def _enclose(self, support: Support) -> State:
        body = support if isinstance(support, Parallelotope) else support.interval_hull().to_parallelotope()
        return np.array(body.center), np.array(body.generators)

    def _make_support(self, state: State) -> Parallelotope:
        return Parallelotope.trusted(*state)

    def _update(self, state: State, C: Matrix, y: Vector, r: Vector) -> tuple[State, int]:
        new = self._blank()
        return new, parallelotope.update(*state, C, y, r, *new, self._work)

    def _predict(self, state: State, arrays: KernelModel, u: Vector, widths: Vector) -> tuple[State, int]:
        new = self._blank()
        work = self._work
        if work.shape[1] < self._model.state_count + widths.size:
            work = parallelotope.scratch(self._model.state_count, widths.size)
        status = parallelotope.predict_image(*state, arrays.A, arrays.B, u, arrays.G, widths, *new, work)
        return new, status

    def _meet_box(self, state: State, lower: Vector, upper: Vector) -> tuple[State, int]:
        new = self._blank()
        return new, parallelotope.meet_box(*state, lower, upper, *new, self._work)

    def _predict_output(self, state: State, r: Vector) -> OutputPrediction:
        m = r.size
        prediction = OutputPrediction(np.empty(m), np.empty(m), np.empty(m))
        parallelotope.predict_output(*state, self._arrays.C, r, *prediction)
        return prediction

    def _blank(self) -> tuple[Vector, Matrix]:
        n = self._model.state_count
        return np.empty(n), np.empty((n, n))
