"""The prior carried through every input: a set that holds the state whatever was measured, or said by others."""

from __future__ import annotations

import math

from lsu_mesh.errors import InconsistentData, UnboundedSupport
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.time_update import predict_step
from lsu_mesh.mesh.messages import Reference
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

MAX_LISTED = 2048
"""Inputs that a set made from the reachable box lists at the most: receivers refuse longer lists."""


class OpenLoop:
    """The reachable box ``X_{k+1} = |A| X_k ⊕ B u_k ⊕ N box(rho)`` of the prior, met with the domain; no data in it.

    Each step by its own model, where there is more than one. It is lost when a node starts from anything but the prior,
    when an input is lost, or when it has outgrown double precision. ``lists_inputs``: whether it remembers which inputs
    were known, because a box may stand in for others.
    """

    def __init__(self, configuration: Configuration, model: LSUModel, *, lists_inputs: bool = False) -> None:
        self._configuration = configuration
        self._model = model
        self._lists_inputs = lists_inputs
        self._engine: LSUO | None = None
        self._inputs: dict[int, Reference] = {}
        """By step; a step without was carried through with the input box."""

    def inputs_before(self, k: int) -> tuple[Reference, ...]:
        """The inputs that went into the box of step k, in order; in the other steps the input box stood in.

        Empty where no input box may stand in, so that all of them did, and where they are more than ``MAX_LISTED``.
        """
        if k - 1 > MAX_LISTED:
            return ()
        return tuple(reference for step, reference in sorted(self._inputs.items()) if step < k)

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
        self._inputs.clear()

    def lose(self) -> None:
        """From now on there is none."""
        self._engine = None
        self._inputs.clear()

    def predict(
        self, u: Drive, k: int, earlier: Drive = None, *, reference: Reference | None = None, since: int | None = None
    ) -> None:
        """Time update of step k with its input, called ``reference``, or with the box of all inputs.

        ``earlier`` is that of the step before, and u acts from ``since`` on, see :func:`predict_step`.
        """
        if self._engine is None:
            return
        self._inputs.pop(k, None)
        if self._lists_inputs and reference is not None and k <= MAX_LISTED:
            self._inputs[k] = reference
        try:
            predict_step(self._engine, self._configuration, k, u=u, earlier=earlier, since=since)
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
