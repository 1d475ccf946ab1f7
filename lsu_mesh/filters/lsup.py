"""LSUP: recursive estimation with a parallelotope as support."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.compiled import CompiledFilter
from lsu_mesh.kernels import parallelotope, step
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support

Matrix = NDArray[np.float64]
TimeUpdate = Literal["image", "cgz", "edges", "strips"]

TIME_UPDATES: dict[str, int] = {
    "image": parallelotope.IMAGE,
    "cgz": parallelotope.CGZ,
    "edges": parallelotope.EDGES,
    "strips": parallelotope.STRIPS,
}
LARGEST_EXHAUSTIVE = 6
"""States up to which ``time_update="edges"`` tries all combinations of edges."""


class LSUP(CompiledFilter):
    """Parallelotope filter: strips of the data (Vicino, Zappa), and a parallelotope around ``A P + B u + N box(rho)``.

    The point estimate is the centre of the parallelotope (eq. 35).

    Parameters
    ----------
    model:
        The system; n states, m outputs.
    prior:
        A set that holds x_1: a parallelotope or a box is used as it is, of other sets the interval hull.
    time_update:
        ``"image"``: edges along A T, which reproduces the papers; ``"cgz"``: noise generators take the place of edges, one
        at a time, where that leaves less volume; ``"edges"``: the best n of all edges, n ≤ 6; ``"strips"``: the image,
        then the faces of the circumscribed box as strips.

    Raises ``ModelError`` on options or a prior that do not fit.
    Source: Lainová et al. 2019, section 3.2; Vicino & Zappa 1996; Chisci, Garulli & Zappa 1996.
    """

    kind: ClassVar[str] = "LSUP"
    family: ClassVar[int] = step.PARALLELOTOPE

    def __init__(self, model: LSUModel, prior: Support, time_update: TimeUpdate = "image") -> None:
        if time_update not in TIME_UPDATES:
            raise ModelError(f"time_update must be one of {', '.join(TIME_UPDATES)}, not {time_update!r}")
        n, q = model.state_count, model.rho.size
        if time_update == "edges" and max(n, q) > LARGEST_EXHAUSTIVE:
            raise ModelError(
                f'time_update="edges" tries all combinations of edges, up to {LARGEST_EXHAUSTIVE} states and noises; '
                f'the model has {n} and {q}: use "cgz" or "strips"'
            )
        super().__init__(model, prior, option=TIME_UPDATES[time_update])
        self.time_update = time_update

    @staticmethod
    def _enclose(support: Support) -> Matrix:
        body = support if isinstance(support, Parallelotope) else support.interval_hull().to_parallelotope()
        return np.vstack([body.center, body.generators])

    @staticmethod
    def _make_support(state: Matrix) -> Parallelotope:
        return Parallelotope.trusted(state[0], state[1:])
