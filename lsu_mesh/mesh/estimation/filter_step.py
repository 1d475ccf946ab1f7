"""One step of a filter: transfers, then the step's measurements. The node and the verification both call it.

Nothing in here knows a message that was published, a clock or an event: the same set, data and rules give the same
set, bit by bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, assert_never

import numpy as np

from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter, GainOf
from lsu_mesh.filters.last_met import is_same
from lsu_mesh.filters.transfer_gain import SETTLED, SizeBefore
from lsu_mesh.mesh.config.settings import OnInconsistency
from lsu_mesh.mesh.estimation.inconsistency import (
    Dropped,
    DroppedStrip,
    update_without_contradicting_strips,
    widen,
)
from lsu_mesh.mesh.estimation.step_data import StepData
from lsu_mesh.mesh.estimation.timed_step import Walk, contradicting_strips, remaining_strips, without
from lsu_mesh.mesh.messages import Fused, Prediction
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


class Transfers(NamedTuple):
    """How a step takes transfers.

    ``as_set`` makes sets of them; ``gain`` says whose volumes are compared before the first and after the last;
    ``None`` adds up what the class measures of each, as older peers did.
    """

    messages: Sequence[Transferred]
    as_set: AsSet
    gain: GainOf | None = "hull"


@dataclass(frozen=True)
class FilterOutcome:
    """What came of a step's data.

    ``transfers`` are those in the set, ``gain`` theirs in nats by the volumes ``gain_of`` (``None``: none is, or the
    hulls show nothing of what was cut); ``factor`` is that by which r was widened; ``error`` says how the data
    contradict the set, and ``dropped`` which rows were left out for it, or ``strips``, of data with moments of their
    own.
    """

    status: Literal["ok", "predicted", "inconsistent"]
    transfers: Sequence[Transferred] = ()
    gain: float | None = None
    gain_of: GainOf | None = None
    rejected: Sequence[RejectedTransfer] = ()
    factor: float = 1.0
    error: InconsistentData | None = None
    dropped: Dropped | None = None
    strips: Sequence[DroppedStrip] = ()

    @property
    def cause(self) -> str | None:
        """How the data contradict the set and what was done, in words; ``None`` where they do not."""
        if self.error is None:
            return None
        return f"{self.error}; r widened by {self.factor:.6g}" if self.status == "ok" else str(self.error)


def contradiction_rule(choice: OnInconsistency) -> Rule:
    """What a step does by ``on_contradiction``; a reset is the node's affair, several steps later."""
    match choice:
        case "widen":
            return "widen"
        case "reset" | "hold":
            return "drop"
        case _:
            assert_never(choice)


def filter_step(engine: Filter, data: StepData, transfers: Transfers, rule: Rule) -> FilterOutcome:
    """Bring one step's data into the engine's set of x(t_k), the prediction.

    Data before t_k go from the posterior of the step before, each at its own moment; then ``condition`` on each
    transfer; then the data at t_k. Transfers give way where the data agree with the set without them. Else data that
    contradict the set are treated by ``rule``; where no factor of r explains them, ``"widen"`` is ``"drop"``.
    """
    if data.y is None:
        return _walked_step(engine, data, transfers, rule)
    before = engine.snapshot()
    found = _bring(engine, transfers)
    if np.isnan(data.y).all():
        return replace(found, status="predicted")
    try:
        data.update(engine)
    except InconsistentData as error:
        if found.transfers and _agrees_without_transfers(engine, data, before):
            return FilterOutcome("ok", rejected=[*found.rejected, *_by_data(found.transfers)])
        return _contradicted(engine, data, replace(found, status="inconsistent", error=error), rule)
    return found


def _by_data(used: Sequence[Transferred]) -> list[RejectedTransfer]:
    return [RejectedTransfer(one, "it contradicts the data", True) for one in used]


def _bring(engine: Filter, transfers: Transfers) -> FilterOutcome:
    """Condition on each; what the data will make of it is not known yet."""
    used: list[Transferred] = []
    rejected: list[RejectedTransfer] = []
    own, gain = engine.support, 0.0
    before = SizeBefore.of(engine, transfers.gain) if transfers.gain is not None and transfers.messages else None
    for message in transfers.messages:
        try:
            gain += engine.condition(transfers.as_set(message), gain=None)
        except InconsistentData as error:
            rejected.append(RejectedTransfer(message, str(error), False))
            continue
        used.append(message)
    if not used:
        return FilterOutcome("ok", rejected=rejected)
    if before is None:
        return FilterOutcome("ok", used, gain, rejected=rejected)
    nats, of = before.gain(engine)
    is_hidden = of == "hull" and nats < SETTLED and not is_same(own, engine.support)
    return FilterOutcome("ok", used, None if is_hidden else nats, of, rejected=rejected)


def _agrees_without_transfers(engine: Filter, data: StepData, before: object) -> bool:
    """Update the set as it was before the transfers; False, and as it was after them, where the data miss that too."""
    after = engine.snapshot()
    engine.restore(before)
    try:
        data.update(engine)
    except InconsistentData:
        engine.restore(after)
        return False
    return True


def _contradicted(engine: Filter, data: StepData, found: FilterOutcome, rule: Rule) -> FilterOutcome:
    """What becomes of data at t_k that are proved to miss the set."""
    match rule:
        case "refuse":
            return found
        case "widen":
            factor = widen(engine, lambda factor: data.update(engine, factor))
            if factor is not None:
                return replace(found, status="ok", factor=factor)
        case "drop":
            pass
        case _:
            assert_never(rule)
    assert data.y is not None
    dropped = update_without_contradicting_strips(engine, data.y, data.r, data.u)
    return replace(found, dropped=dropped)


def _walked_step(engine: Filter, data: StepData, transfers: Transfers, rule: Rule) -> FilterOutcome:
    """A step whose data have moments of their own."""
    walk = Walk(data, engine.snapshot())
    found = FilterOutcome("ok")

    def bring_transfers() -> None:
        nonlocal found
        found = _bring(engine, transfers)

    try:
        walk.go(engine, bring_transfers)
    except InconsistentData as error:
        if found.transfers and _goes(engine, walk):
            return FilterOutcome("ok", rejected=[*found.rejected, *_by_data(found.transfers)])
        engine.restore(walk.prediction)
        if rule == "refuse":
            return replace(found, status="inconsistent", error=error)
        if rule == "widen":
            factor = widen(engine, lambda factor: walk.go(engine, bring_transfers, factor))
            if factor is not None:
                return replace(found, factor=factor, error=error)
            engine.restore(walk.prediction)
        strips = _go_without_contradicting(engine, walk, bring_transfers)
        return replace(found, status="inconsistent", error=error, strips=strips)
    return found


def _goes(engine: Filter, walk: Walk) -> bool:
    """Whether the data agree with the set without transfers."""
    try:
        walk.go(engine, lambda: None)
    except InconsistentData:
        return False
    return True


def _go_without_contradicting(
    engine: Filter, walk: Walk, bring_transfers: Callable[[], None]
) -> tuple[DroppedStrip, ...]:
    """Make the step anew without the strips that alone contradict the set; without any data where that does not do."""
    alone = contradicting_strips(engine, walk)
    left = without(walk.data, alone)
    if alone:
        try:
            Walk(left, walk.prediction).go(engine, bring_transfers)
        except InconsistentData:
            pass
        else:
            return tuple(strip for _, _, strip in alone)
    engine.restore(walk.prediction)
    together = remaining_strips(engine, left)
    bring_transfers()
    return (*(strip for _, _, strip in alone), *together)
