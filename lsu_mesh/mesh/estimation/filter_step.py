"""One step of a filter: transfers, then the step's measurements. The node and the verification both call it.

Nothing in here knows a message that was published, a clock or an event: the same set, data and rules give the same
set, bit by bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, assert_never

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.mesh.config.settings import Configuration, OnInconsistency
from lsu_mesh.mesh.estimation.inconsistency import Dropped, update_without_contradicting_strips, widen
from lsu_mesh.mesh.messages import Fused, Measurement, Prediction
from lsu_mesh.supports.support import Support

Transferred = Prediction | Fused
AsSet = Callable[[Transferred], Support]
"""The set of the step that a transfer stands for; ``InconsistentData`` where it is empty."""
Rule = Literal["drop", "widen", "refuse"]
"""What to do with data that are proved to miss the set: drop strips, widen r, or leave the set as it is."""


class RejectedTransfer(NamedTuple):
    """A transfer that is not in the set, and why."""

    message: Transferred
    reason: str
    by_data: bool
    """Whether the step's data, and not the set, contradict it."""


@dataclass(frozen=True)
class FilterOutcome:
    """What came of a step's data.

    ``transfers`` are those in the set, ``gain`` theirs in nats (``None``: none is); ``factor`` is that by which r was
    widened; ``error`` says how the data contradict the set, and ``dropped`` which rows were left out for it.
    """

    status: Literal["ok", "predicted", "inconsistent"]
    transfers: Sequence[Transferred] = ()
    gain: float | None = None
    rejected: Sequence[RejectedTransfer] = ()
    factor: float = 1.0
    error: InconsistentData | None = None
    dropped: Dropped | None = None


def contradiction_rule(choice: OnInconsistency) -> Rule:
    """What a step does by ``on_contradiction``; a reset is the node's affair, several steps later."""
    match choice:
        case "widen":
            return "widen"
        case "reset" | "hold":
            return "drop"
        case _:
            assert_never(choice)


def stack(configuration: Configuration, sensors: Sequence[str], measured: Mapping[str, Measurement]) -> Vector:
    """Measured outputs (m,) by sensor, then row; NaN where missing."""
    y: list[float] = []
    for sensor in sensors:
        message = measured.get(sensor)
        values = [None] * len(configuration.sensors[sensor].C) if message is None else message.y
        y += [np.nan if value is None else value for value in values]
    return np.array(y, dtype=np.float64)


def filter_step(
    engine: Filter, y: Vector, transfers: Sequence[Transferred], as_set: AsSet, rule: Rule
) -> FilterOutcome:
    """Bring one step's data into the engine's set: ``condition`` on each transfer, then ``update`` with y (m,).

    Transfers give way where the data agree with the set without them. Else data that contradict the set are treated
    by ``rule``; where no factor of r explains them, ``"widen"`` is ``"drop"``.
    """
    before = engine.snapshot()
    used, gain, rejected = _bring(engine, transfers, as_set)
    if np.isnan(y).all():
        return FilterOutcome("predicted", used, gain, rejected)
    try:
        engine.update(y)
    except InconsistentData as error:
        if used and _agrees_without_transfers(engine, y, before):
            why = "it contradicts the data"
            return FilterOutcome("ok", rejected=[*rejected, *(RejectedTransfer(one, why, True) for one in used)])
        return _contradicted(engine, y, FilterOutcome("inconsistent", used, gain, rejected, error=error), rule)
    return FilterOutcome("ok", used, gain, rejected)


def _bring(
    engine: Filter, transfers: Sequence[Transferred], as_set: AsSet
) -> tuple[list[Transferred], float | None, list[RejectedTransfer]]:
    used: list[Transferred] = []
    rejected: list[RejectedTransfer] = []
    gain = 0.0
    for message in transfers:
        try:
            gain += engine.condition(as_set(message))
        except InconsistentData as error:
            rejected.append(RejectedTransfer(message, str(error), False))
            continue
        used.append(message)
    return used, gain if used else None, rejected


def _agrees_without_transfers(engine: Filter, y: Vector, before: object) -> bool:
    """Update the set as it was before the transfers; False, and as it was after them, where y misses that too."""
    after = engine.snapshot()
    engine.restore(before)
    try:
        engine.update(y)
    except InconsistentData:
        engine.restore(after)
        return False
    return True


def _contradicted(engine: Filter, y: Vector, found: FilterOutcome, rule: Rule) -> FilterOutcome:
    """What becomes of data that are proved to miss the set."""
    match rule:
        case "refuse":
            return found
        case "widen":
            factor = widen(engine, y)
            if factor is not None:
                return FilterOutcome(
                    status="ok",
                    transfers=found.transfers,
                    gain=found.gain,
                    rejected=found.rejected,
                    factor=factor,
                    error=found.error,
                )
        case "drop":
            pass
        case _:
            assert_never(rule)
    dropped = update_without_contradicting_strips(engine, y)
    return FilterOutcome(
        "inconsistent", found.transfers, found.gain, found.rejected, error=found.error, dropped=dropped
    )
