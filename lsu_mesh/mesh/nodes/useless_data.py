"""Sources whose data are all useless: too late, too early, or all of one step; by name, with the remedy.

A datum that is too late or too early is refused or left out, one by one, and the sets stay right without it. Where a
source sends nothing else, its clock or its counter is wrong, and a person has to know which and by how much.
"""

from __future__ import annotations

from collections import deque
from statistics import median
from typing import NamedTuple

from lsu_mesh.mesh.messages import Refused
from lsu_mesh.mesh.nodes.node import SECOND

LASTING_NS = SECOND
"""So long nothing useful has come from a source that is complained of."""
STEPS_OF_ONE = 2.5
"""And, where all is of one step, for so many steps of the mesh: more data than one may belong to a step."""
SILENT_NS, SILENT_GAPS = 3 * SECOND, 3
"""A source that has sent nothing at all for so long, and for so many of its gaps, is complained of as silent."""
MAX_OFFS = 31
LATE, EARLY, ONE_STEP = "late", "early", "of one step"
USELESS, USED_AGAIN = "useless-data", "data-used-again"
"""Codes of the events."""


class News(NamedTuple):
    """What begins (``seconds`` and ``reason`` say what is wrong) or is over."""

    code: str
    source: str
    text: str
    reason: str
    seconds: float


class _Row:
    """Data of one source in a row that are useless for one reason."""

    def __init__(self, reason: str, step: int, now: int) -> None:
        self.reason, self.step = reason, step
        self.count = 0
        self.first_at = self.last_at = now
        self.is_told = False
        self._offs: deque[float] = deque(maxlen=MAX_OFFS)

    def add(self, seconds: float, now: int) -> None:
        """One more."""
        self.count += 1
        self.last_at = now
        self._offs.append(seconds)

    @property
    def seconds(self) -> float:
        """By how much the recent ones are late (below 0: early)."""
        return median(self._offs)

    def lasts(self, least_ns: int, now: int) -> bool:
        """Whether there is nothing else for so long, and the source still sends."""
        span = self.last_at - self.first_at
        gap = span // max(1, self.count - 1)
        return self.count > 1 and span >= least_ns and now - self.last_at <= max(SILENT_NS, SILENT_GAPS * gap)


class UselessData:
    """The sources of one estimator.

    Parameters
    ----------
    kinds:
        Source names, each with what it is: ``{"gps": "sensor"}``.
    rate:
        Steps per second of the mesh.
    history:
        How the configuration calls the option that says how far back late data reach, and how many steps it is.
    """

    def __init__(self, kinds: dict[str, str], rate: float, history: tuple[str, int]) -> None:
        self._kinds = kinds
        self._rate = rate
        self._history = history
        self._bad: dict[str, _Row] = {}
        self._same: dict[str, _Row] = {}
        """Those of one step, useful or not."""
        self._over: list[News] = []
        self._counts: dict[str, float] = {}

    # -- what came

    def record_used(self, source: str) -> None:
        """A datum that is of use."""
        self._end(self._bad.pop(source, None), source)

    def record_off(self, source: str, steps: int, now: int) -> None:
        """A datum that is left out: so many steps too late, or, below 0, too early."""
        self.record_seconds(source, LATE if steps > 0 else EARLY, steps / self._rate, now=now)

    def record_refused(self, refusal: Refused, now: int) -> None:
        """A datum that admission has refused for its time."""
        if refusal.seconds is not None:
            self.record_seconds(refusal.source, refusal.reason, refusal.seconds, now=now)

    def record_seconds(self, source: str, reason: str, seconds: float, *, now: int) -> None:
        """A datum that is left out for a reason, so many seconds late."""
        if source not in self._kinds:
            return
        counted = f"not used.{source}.{reason}"
        self._counts[counted] = self._counts.get(counted, 0) + 1
        row = self._bad.get(source)
        if row is None or row.reason != reason:
            is_told = row is not None and row.is_told
            row = self._bad[source] = _Row(reason, 0, now)
            row.is_told = is_told
        row.add(seconds, now)

    def record_step(self, source: str, step: int, now: int) -> None:
        """The step of whatever a source sends, useful or not."""
        row = self._same.get(source)
        if row is None or row.step != step:
            self._end(row, source)
            row = self._same[source] = _Row(ONE_STEP, step, now)
        row.add(0.0, now)

    # -- what is said

    def complaints(self, now: int) -> list[str]:
        """One for each source that sends nothing useful."""
        return [self._words(source, row) for source, row in self._lasting(now)]

    def take_news(self, now: int) -> list[News]:
        """What has begun, and what is over, since the last call."""
        news, self._over = self._over, []
        for source, row in self._lasting(now):
            if not row.is_told:
                row.is_told = True
                text = self._words(source, row)
                news.append(News(USELESS, source, text, reason=row.reason, seconds=row.seconds))
        return news

    @property
    def counters(self) -> dict[str, float]:
        """Data that were left out, by source and reason."""
        return self._counts

    def _lasting(self, now: int) -> list[tuple[str, _Row]]:
        of_one = max(LASTING_NS, int(STEPS_OF_ONE * SECOND / self._rate))
        found = []
        for source in self._kinds:
            same, bad = self._same.get(source), self._bad.get(source)
            if same is not None and same.lasts(of_one, now):
                found.append((source, same))
            elif bad is not None and bad.lasts(LASTING_NS, now):
                found.append((source, bad))
        return found

    def _end(self, row: _Row | None, source: str) -> None:
        if row is not None and row.is_told:
            text = f"{self._kinds[source]} {source}: its data are used again"
            self._over.append(News(USED_AGAIN, source, text, reason=row.reason, seconds=0.0))

    def _words(self, source: str, row: _Row) -> str:
        kind = self._kinds[source]
        data = "data" if kind == "sensor" else "sets"
        span = (row.last_at - row.first_at) / SECOND
        begin = f"{kind} {source}: all {data} of the last {span:.1f} s are"
        if row.reason == ONE_STEP:
            remedy = "its clock or its counter stands still: each datum needs the time at which it was measured"
            return f"{begin} of step {row.step}; {remedy}"
        off, direction = abs(row.seconds), LATE if row.seconds > 0 else EARLY
        by = f"{off:.2f} s" if off < 10 else f"{off:,.0f} s"
        return f"{begin} {by} too {direction} and not used; {self._remedy(kind, row.reason, direction)}"

    def _remedy(self, kind: str, reason: str, direction: str) -> str:
        if reason in ("past", "future"):
            return f"set the clock of its host or of this one, or raise [mesh] {reason}"
        clock = "set the clock of its host, or start it with the start of the mesh"
        if direction == EARLY:
            return f"{clock}: steps count from 1 at that start"
        name, steps = self._history
        more = f"raise {name} (now {steps} steps, {steps / self._rate:.2g} s)"
        return f"{clock}, or {more}" if kind == "sensor" else more
