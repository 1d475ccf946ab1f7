"""Status and epoch of the sets of one process, recomputed in the order in which it published them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lsu_mesh.mesh.estimation.fusion_step import OUTVOTED
from lsu_mesh.mesh.messages import Event, Fused, Measurement, Posterior, Prediction, Reference
from lsu_mesh.mesh.verification.process_events import ProcessEvents
from lsu_mesh.mesh.verification.recomputed import Recomputed

Set = Posterior | Prediction
MISSED_BASE = "epoch: of a prediction whose posterior the recorder missed"
EARLIER_LIFE = "epoch: of a process's first set, which continues an earlier process that is not in the recording"
GAP = "status: whether it is the first set since a start, because the recorder missed the one before"
OTHER_NUMBER = "status: whether the data contradict a set of another algorithm"


class FalseClaim(NamedTuple):
    """A claim of a set that is false, and what it should be."""

    message: Set
    field: str
    expected: object


def is_own(message: Set) -> bool:
    """Whether a set was made from one of the same process."""
    return isinstance(message.base, tuple) and message.base[1:3] == (message.src, message.boot)


def is_start(message: Set) -> bool:
    """Whether a set was made from something that a process starts from in the middle of a run."""
    return message.base is not None and message.base != "prior" and not is_own(message)


class ProcessClaims:
    """Checks status and epoch of the sets of one (src, boot).

    ``epochs`` are the epochs of the earlier lives of the peer that are in the recording.
    """

    def __init__(self, sets: Sequence[Set], events: Sequence[Event], epochs: Sequence[int]) -> None:
        self._posteriors = sorted((one for one in sets if isinstance(one, Posterior)), key=lambda one: one.seq)
        self._predictions = [one for one in sets if isinstance(one, Prediction)]
        self._by_reference = {one.reference: one for one in self._posteriors}
        first = min(sets, key=lambda one: (one.sent_ns, one.step))
        self._events = ProcessEvents(events, first)
        self._epochs = set(epochs)
        self.unproved: list[str] = []

    def check(self, recomputed: dict[Reference, Recomputed | None]) -> Iterator[FalseClaim]:
        """All claims that are false."""
        before: Posterior | None = None
        pending: bool | None = False
        for message in self._posteriors:
            is_next = before is None or message.seq == before.seq + 1
            yield from self._check_epoch(message, before, is_next=is_next)
            if is_start(message) and (message.revision == 0 or before is None or message.epoch > before.epoch):
                pending = True
            elif not is_next:
                pending = None
            expected = self._statuses(message, recomputed.get(message.reference), pending)
            if message.status not in expected:
                yield FalseClaim(message, "status", " or ".join(sorted(expected)))
            if "inconsistent" not in expected:
                pending = False
            before = message
        for prediction in self._predictions:
            yield from self._check_prediction(prediction)

    # -- status

    def _statuses(self, message: Posterior, recomputed: Recomputed | None, pending: bool | None) -> set[str]:
        """The statuses that a set may have."""
        if self._is_inconsistent(message):
            return {"inconsistent"}
        data = recomputed.status if recomputed is not None else self._data_status(message)
        if data == "inconsistent":
            return {"inconsistent"}
        if data is None:
            self.unproved.append(OTHER_NUMBER)
            return {"restarted", "inconsistent"} if pending else {"ok", "inconsistent"}
        if pending is None:
            self.unproved.append(GAP)
            return {"restarted", data}
        return {"restarted"} if pending else {data}

    def _is_inconsistent(self, message: Posterior) -> bool:
        """Whether the events, or what was rejected, say that nothing of the step's data could be believed."""
        if not isinstance(message, Fused):
            return self._events.is_reset_by_data(message) or self._events.is_unsound(message)
        if self._events.has_too_many_faults(message):
            return True
        if message.used and not is_start(message) and message.status != "inconsistent":
            return False
        has_sources = any(reference[0] in ("posterior", "fused") for reference in message.used)
        is_family_of_none = not has_sources and any(one.reason == OUTVOTED for one in message.rejected)
        is_unsound = not is_start(message) and not has_sources and self._events.is_unsound(message)
        return is_family_of_none or (is_unsound and self._is_without_start_since(message))

    def _is_without_start_since(self, message: Posterior) -> bool:
        """Whether the process has published no set of its present epoch that was made from a start."""
        mine = [one for one in self._posteriors if one.epoch == message.epoch and one.seq < message.seq]
        return not any(is_start(one) for one in mine)

    @staticmethod
    def _data_status(message: Posterior) -> str | None:
        """By what was used: without data a set is predicted; whether data agree is the arithmetic's to say."""
        if isinstance(message, Fused):
            return "ok" if any(reference[0] != "input" for reference in message.used) else "predicted"
        return None if any(reference[0] == Measurement.topic for reference in message.used) else "predicted"

    # -- epoch

    def _check_epoch(self, message: Posterior, before: Posterior | None, *, is_next: bool) -> Iterator[FalseClaim]:
        told = self._events.told(message)
        if is_own(message):
            base = self._by_reference.get(message.base)  # type: ignore[arg-type]
            if base is None or message.epoch == base.epoch:
                return
            if message.status == "inconsistent" and message.epoch in told:
                return  # the epoch was left, and there was nothing to start again from
            yield FalseClaim(message, "epoch", base.epoch)
        elif before is None:
            yield from self._check_first(message, told)
        elif is_next:
            later = {number for number in told if number > before.epoch}
            if message.epoch not in (later or {before.epoch}):
                yield FalseClaim(message, "epoch", " or ".join(map(str, sorted(later or {before.epoch}))))

    def _check_first(self, message: Posterior, told: set[int]) -> Iterator[FalseClaim]:
        if message.epoch in told | self._epochs | {0}:
            return
        if message.base == "prior" and message.seq == 0 and not self._epochs:
            yield FalseClaim(message, "epoch", 0)
        else:
            self.unproved.append(EARLIER_LIFE)

    def _check_prediction(self, message: Prediction) -> Iterator[FalseClaim]:
        """A prediction is of its base's epoch; one that was made anew is of a later one."""
        base = self._by_reference.get(message.base) if isinstance(message.base, tuple) else None
        if base is not None and message.epoch != base.epoch:
            yield FalseClaim(message, "epoch", base.epoch)
        elif base is None and isinstance(message.base, tuple) and message.base[1:3] == (message.src, message.boot):
            self.unproved.append(MISSED_BASE)
        elif base is None and message.base is not None and message.epoch not in self._events.told(message):
            yield FalseClaim(message, "epoch", "one that an event told of")
