"""The systems of the papers, by name.

========  =====================================================  ==========================================
``S1``    3 states, 1 input, 1 output                            Lainová et al. 2019, eq. (46)
``S2``    position and velocity, 1 idle input, 1 output          Lainová et al. 2019, eq. (47)
``S3``    2 states, 1 input, 1 output                            Lainová et al. 2019, eq. (48)
``P3``    3 states, 1 input, 2 outputs                           Pavelková & Jirsa 2018, eq. (15)
========  =====================================================  ==========================================
"""

from __future__ import annotations

import difflib
from typing import NamedTuple

from numpy.typing import ArrayLike

from lsu_mesh.errors import ModelError
from lsu_mesh.model import LSUModel

Rows = tuple[tuple[float, ...], ...]


class System(NamedTuple):
    """Matrices A (n, n), B (n, p), C (m, n) and the half-widths rho, r that the paper uses (one for all entries)."""

    A: Rows
    B: Rows
    C: Rows
    rho: float
    r: float


SYSTEMS: dict[str, System] = {
    "S1": System(
        A=((0.4, -0.3, 0.1), (-0.4, 0.4, 0.0), (0.3, 0.2, 0.1)),
        B=((0.1,), (0.6,), (0.3,)),
        C=((-1.0, 0.9, -0.5),),
        rho=0.1,
        r=0.01,
    ),
    "S2": System(A=((1.0, 1.0), (0.0, 1.0)), B=((0.0,), (0.0,)), C=((1.0, 0.0),), rho=0.1, r=0.1),
    "S3": System(
        A=((0.8144, -0.0905), (0.0905, 0.9953)),
        B=((0.0905,), (0.0047,)),
        C=((0.0, 1.0),),
        rho=0.1,
        r=0.1,
    ),
    "P3": System(
        A=((1.0, -0.5, 0.2), (0.5, 0.1, 0.0), (0.3, 0.0, -0.1)),
        B=((0.1,), (0.6,), (0.3,)),
        C=((1.0, 0.0, 0.5), (0.0, 1.0, 0.5)),
        rho=0.1,
        r=0.3,
    ),
}


def get(name: str, rho: ArrayLike | None = None, r: ArrayLike | None = None) -> LSUModel:
    """The system as a model; rho and r default to the paper's half-widths.

    Raises ``ModelError`` that names the nearest valid system.
    """
    if name not in SYSTEMS:
        near = difflib.get_close_matches(name.upper(), SYSTEMS, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise ModelError(f"there is no system {name!r}{hint} (valid: {', '.join(SYSTEMS)})")
    system = SYSTEMS[name]
    return LSUModel(
        system.A,
        system.B,
        system.C,
        rho=system.rho if rho is None else rho,
        r=system.r if r is None else r,
    )
