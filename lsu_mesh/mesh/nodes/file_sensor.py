"""Sensors that play a file of real measurements."""

from __future__ import annotations

from collections.abc import Sequence

from lsu_mesh.mesh.access import PUBLISHES
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Measurement, Message
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.played_rows import PlayedRows
from lsu_mesh.mesh.nodes.rate_limit import RateLimit
from lsu_mesh.mesh.nodes.schedule import MAX_AT_ONCE, GridSchedule, Schedule
from lsu_mesh.mesh.nodes.sensor import listed
from lsu_mesh.mesh.nodes.time_fields import time_fields


class FileSensorNode(Node):
    """Plays every row of a file, each at its own time, those of a step when the step is due.

    An empty cell is a missing output. A step between the first and the last ends with a measurement at t_k: where the
    file has none, it is one of nothing, which tells filters that no more comes, so that they need not wait.
    A sensor that starts late begins with what it would still keep for others, and does not catch up all at once.
    """

    role = "sensor"
    publishes = PUBLISHES["sensor"]

    def __init__(self, configuration: Configuration, name: str, boot: str, schedule: Schedule | GridSchedule) -> None:
        super().__init__(configuration, name, boot)
        self._rows = PlayedRows(configuration, name)
        self._size = len(configuration.sensors[name].C)
        self._schedule = schedule
        self._next, self._last = self._rows.first, self._rows.last
        self.messages_per_step = self._rows.most_per_step + self._rows.is_by_time
        self._pace = RateLimit(configuration.mesh.rate, configuration.cached)
        self._has_told = self._rows.before == 0
        self._has_begun = False
        """Whether a step has been due."""

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return ()

    def receive(self, message: Message, now: int) -> list[Message]:
        return []

    def record_links(self, count: int, now: int) -> None:
        super().record_links(count, now)
        self._pace.record_links(count, now)

    def advance(self, now: int) -> list[Message]:
        messages: list[Message] = [] if self._has_told else [self._told_left_out(now)]
        due = min(self._schedule.due(now), self._last)
        if not self._has_begun and due:
            self._has_begun = True
            kept = self.configuration.cached
            self._next = max(self._next, due + 1 - kept)  # what came before would be too late for everybody
        steps = self._pace.take(min(MAX_AT_ONCE, due + 1 - self._next), now)
        for k in range(self._next, self._next + steps):
            messages += self._of_step(k, now)
        self._next += steps
        return messages

    def _told_left_out(self, now: int) -> Message:
        self._has_told = True
        count = self._rows.before
        text = f"{count} row(s) are before the first step, of which the prior is, and are left out"
        about: dict[str, str | int | float | None] = {"sensor": self.name, "rows": count}
        return self.event("WARN", "rows-before-the-prior", text, now=now, step=0, about=about)

    def _of_step(self, k: int, now: int) -> list[Measurement]:
        grid, rows = self.configuration.grid, self._rows.of(k)
        end = grid.time_of(k)
        told = [
            Measurement(
                **self.stamp("measurement", k, now), y=listed(row.y), **time_fields(grid, row.time_ns, row.error_ns)
            )
            for row in rows
        ]
        if not rows or rows[-1].time_ns != end:
            nothing: list[float | None] = [None] * self._size
            told.append(Measurement(**self.stamp("measurement", k, now), y=nothing, **time_fields(grid, end, 0)))
        return told

    def counters(self) -> dict[str, float]:
        counts = {"before the prior": self._rows.before, "after the last step": self._rows.after}
        return {words: float(count) for words, count in counts.items() if count}

    def wakeup(self) -> int | None:
        due = None if self.finished else self._schedule.time_of(self._next)
        return None if due is None else max(due, self._pace.ready_at())

    @property
    def finished(self) -> bool:
        return self._next > self._last

    def step(self) -> int:
        return self._next - 1
