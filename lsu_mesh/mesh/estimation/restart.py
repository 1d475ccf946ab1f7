"""Sound sets from which a filter can start again in the middle of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, UnboundedSupport
from lsu_mesh.filters.filter import Filter
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.epochs import Epochs
from lsu_mesh.mesh.estimation.open_loop import OpenLoop
from lsu_mesh.mesh.estimation.step_data import StepData
from lsu_mesh.mesh.estimation.time_update import predict_step
from lsu_mesh.mesh.estimation.transfer import MAX_BOX_AGE, SOUND
from lsu_mesh.mesh.messages import Base, Fused, Input, Reference
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.supports.orthotope import Orthotope


@dataclass(frozen=True)
class Start:
    """A sound set to start again from."""

    set: object
    """Snapshot of the engine that holds it."""
    base: Base
    words: str
    used: Sequence[Reference] = ()
    message: Fused | None = None

    @property
    def guarantee(self) -> str:
        return "declared" if self.message is None else self.message.guarantee


class RestartSearch:
    """Remembers the newest sound set of each fusion, and finds one that meets the data."""

    def __init__(self, configuration: Configuration, epochs: Epochs) -> None:
        self._configuration = configuration
        self._epochs = epochs
        self._fused: dict[str, Fused] = {}

    def record(self, message: Fused) -> None:
        """Remember a fused set if it is sound and not older than the known one."""
        known = self._fused.get(message.name)
        if message.status in SOUND and (known is None or message.step >= known.step):
            self._fused[message.name] = message

    def forget(self) -> None:
        """What is known rests on bounds that are no longer believed."""
        self._fused.clear()

    def find(
        self, engine: Filter, data: StepData, reach: OpenLoop, inputs: Mapping[int, Input], *, abandons: bool
    ) -> Start | None:
        """A set of the step, before its data, that is sound and meets them; ``None`` where there is none.

        In this order: a fused set carried forward, if it does not descend from the epoch that is left (``abandons``);
        the prior carried through every input (``reach``); the domain. Sets with a declared guarantee come first. The
        engine is only borrowed.
        """
        before, k = engine.snapshot(), data.k
        newest_first = sorted(self._fused.values(), key=lambda fused: -fused.step)
        carried_on = (self._carried(engine, fused, k, inputs=inputs, abandons=abandons) for fused in newest_first)
        starts = [start for start in carried_on if start is not None]
        box, domain = reach.box, engine.model.domain
        if box is not None:
            words = "the prior carried through all inputs"
            starts.append(Start(_holding(engine, box), "reach", words, reach.inputs_before(k)))
        if domain is not None:
            starts.append(Start(_holding(engine, domain), "domain", "the domain"))
        starts.sort(key=lambda start: start.guarantee != "declared")
        met = None
        for start in starts:
            engine.restore(start.set)
            if data.agrees(engine):
                met = start
                break
        engine.restore(before)
        return met

    def _carried(
        self, engine: Filter, fused: Fused, k: int, inputs: Mapping[int, Input], abandons: bool
    ) -> Start | None:
        """A fused set of step k or before, carried to step k."""
        if not k - MAX_BOX_AGE <= fused.step <= k or self._epochs.is_abandoned(fused):
            return None
        if abandons and self._epochs.is_descendant(fused):
            return None
        used: list[Reference] = []
        earlier: Vector | None = None
        try:
            engine.reset(to_support(fused.support))
        except InconsistentData:  # it is empty: whoever sent it was wrong
            return None
        for j in range(fused.step, k):
            message = inputs.get(j)
            if engine.model.input_count and message is None:
                return None
            u = None if message is None else np.array(message.u)
            try:
                predict_step(
                    engine, self._configuration, j, u=u, earlier=earlier, since=message.time_ns if message else None
                )
            except (InconsistentData, UnboundedSupport):
                return None
            used += [] if message is None else [message.reference]
            earlier = u
        return Start(
            set=engine.snapshot(),
            base=fused.reference,
            words=f"the fused set of step {fused.step}",
            used=used,
            message=fused,
        )


def _holding(engine: Filter, support: Orthotope) -> object:
    engine.reset(support)
    return engine.snapshot()
