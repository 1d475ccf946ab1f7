"""The prior carried through every input: a set that holds the state whatever was measured, or said by others."""

from __future__ import annotations

import math

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, UnboundedSupport
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support


class OpenLoop:
    """The reachable box ``X_{k+1} = |A| X_k ⊕ B u_k ⊕ N box(rho)`` of the prior, met with the domain; no data in it.

    It is lost when a node starts from anything but the prior, when an input is lost, or when it has outgrown double
    precision.
    """

    def __init__(self, model: LSUModel) -> None:
        self._model = model
        self._engine: LSUO | None = None

    @property
    def box(self) -> Orthotope | None:
        """The box of the current step, or ``None`` where it is lost or too wide to be told."""
        if self._engine is None:
            return None
        lower, upper = self._engine.bounds()
        is_finite = all(map(math.isfinite, [*lower, *upper]))
        return Orthotope(lower, upper) if is_finite else None

    def begin(self, prior: Support) -> None:
        """Hold the prior of step 1."""
        self._engine = LSUO(self._model, prior)

    def lose(self) -> None:
        """From now on there is none."""
        self._engine = None

    def predict(self, u: Vector | Orthotope | None) -> None:
        """Time update with the step's input, or with the box of all inputs."""
        if self._engine is None:
            return
        try:
            self._engine.predict(u)
        except (UnboundedSupport, InconsistentData):
            self.lose()

    def snapshot(self) -> object:
        """The state, for :meth:`restore`."""
        return None if self._engine is None else self._engine.snapshot()

    def restore(self, snapshot: object) -> None:
        """Return to a state taken by :meth:`snapshot`."""
        if snapshot is None or self._engine is None:
            self.lose()
        else:
            self._engine.restore(snapshot)
