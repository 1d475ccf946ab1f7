"""Which sources of a fusion are left out repeatedly."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

from lsu_mesh.mesh.messages import Message

Say = Callable[[str, bool], Message]
"""The event that names a source and says whether it goes in."""


class Record(NamedTuple):
    """What is known of one source."""

    left_out: int = 0
    """Steps at which it was left out, since it last agreed for long."""
    agreed: int = 0
    """Steps in a row, of those at which it was there, at which it was not left out."""
    is_member: bool = False
    """Whether it is quarantined."""


class Quarantine:
    """Names the sources that are left out ``after`` times, until they have agreed ``after`` times in a row.

    It changes no set: a quarantined source still counts among the m of which ``faults`` may lie, because it may be
    right again while another one begins to lie. A step that is done again, because something came late, replaces what
    was noted of it; of steps more than ``history`` back the last word stands. A source that is not there is neither
    left out nor does it agree.
    """

    def __init__(self, sources: Sequence[str], after: int, history: int) -> None:
        self._after = after
        self._history = history
        self._settled = dict.fromkeys(sources, Record())
        """Records up to the oldest step that may be done again."""
        self._records = self._settled
        """Records up to the newest step."""
        self._newest = 0
        self._verdicts: dict[int, dict[str, bool]] = {}
        """Of each later step, the sources that were there, and whether they were left out."""
        self.members: set[str] = set()

    def record(self, k: int, left_out: Collection[str], agreed: Collection[str], say: Say) -> list[Message]:
        """Record step k; events for the sources that are quarantined now, and for those that are used again."""
        verdict = dict.fromkeys(agreed, False) | dict.fromkeys(left_out, True)
        self._verdicts[k] = verdict
        if k > self._newest:
            self._newest = k
            self._records = self._with(self._records, verdict)
            for old in sorted(step for step in self._verdicts if step < k - self._history):
                self._settled = self._with(self._settled, self._verdicts.pop(old))
        else:
            self._records = self._settled
            for step in sorted(self._verdicts):
                self._records = self._with(self._records, self._verdicts[step])
        members = {name for name, record in self._records.items() if record.is_member}
        changed, self.members = sorted(members ^ self.members), members
        return [say(name, name in members) for name in changed]

    def _with(self, records: dict[str, Record], verdict: dict[str, bool]) -> dict[str, Record]:
        return records | {name: self._next(records[name], was_left_out) for name, was_left_out in verdict.items()}

    def _next(self, record: Record, was_left_out: bool) -> Record:
        if was_left_out:
            count = record.left_out + 1
            return Record(count, 0, record.is_member or count >= self._after)
        run = record.agreed + 1
        return Record(0, run, False) if run >= self._after else record._replace(agreed=run)
