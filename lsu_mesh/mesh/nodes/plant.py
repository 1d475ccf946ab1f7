"""A plant: publishes the input of every step, and the true state where it is simulated."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lsu_mesh.mesh.access import PUBLISHES, truth_is_known
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Input, Message, Truth
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.plant_course import PlantCourse
from lsu_mesh.mesh.nodes.rate_limit import RateLimit
from lsu_mesh.mesh.nodes.schedule import MAX_AT_ONCE, GridSchedule, Schedule

PAST_SECONDS, LEAST_PAST = 30.0, 256
"""So much of the past, and so many steps, a plant that starts late publishes the inputs of: filters need every one."""
PAST_PACE_NS = 4_000_000
"""Between two bursts of past inputs: receivers have to take them besides all else."""
SILENT_AT_ONCE = 20_000
"""Steps of a longer past that are simulated in one tick, in silence."""


class PlantNode(Node):
    """The state and the inputs of :class:`PlantCourse`, step by step.

    Where no sensor is simulated there is no truth: then the inputs alone are published, and of a recording only those
    that it has. A plant that is started again is at the current step at once, with the same values.
    """

    role = "plant"
    publishes = PUBLISHES["plant"]

    def __init__(self, configuration: Configuration, name: str, boot: str, schedule: Schedule | GridSchedule) -> None:
        super().__init__(configuration, name, boot)
        self._course = PlantCourse(configuration)
        self._tells_truth = truth_is_known(configuration)
        self._schedule = schedule
        self._pace = RateLimit(configuration.mesh.rate, configuration.cached)
        self._last = min((end for end in (configuration.mesh.steps, self._course.end) if end is not None), default=None)
        self._next = 1
        self._not_before = 0
        """When the next burst of past inputs may go out."""
        self._past: range | None = None
        """Steps whose inputs alone are published, because they are over; known with the first tick."""
        self._x = self._course.first
        self._missing = 0
        """Inputs that a recording does not have, and that nobody knows."""

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return ()

    def warm_up(self) -> None:
        if self._tells_truth:
            self._course.next(1, self._x)

    def receive(self, message: Message, now: int) -> list[Message]:
        return []

    def record_links(self, count: int, now: int) -> None:
        super().record_links(count, now)
        self._pace.record_links(count, now)

    def advance(self, now: int) -> list[Message]:
        due = self._schedule.due(now)
        if self._last is not None:
            due = min(due, self._last)
        if due < self._next:
            return []
        if self._past is None:
            self._past = self._past_before(due)
        if self._next < self._past.stop:
            return self._catch_up(self._past, now)
        steps = self._pace.take(min(MAX_AT_ONCE, due + 1 - self._next), now)
        messages: list[Message] = []
        for k in range(self._next, self._next + steps):
            if self._tells_truth:
                messages.append(Truth(**self.stamp("truth", k, now), x=self._x.tolist()))
            messages += self._drive(k, now, publish=True)
        return messages

    def _past_before(self, due: int) -> range:
        """The steps before the one that is due, as far back as inputs are repeated; none for a plant in time."""
        if due <= MAX_AT_ONCE:
            return range(0)
        repeated = max(LEAST_PAST, math.ceil(PAST_SECONDS * self.configuration.mesh.rate))
        return range(max(1, due - repeated), due)

    def _catch_up(self, past: range, now: int) -> list[Message]:
        """Simulate the past in silence, but for its newest inputs, oldest first, in bursts."""
        silent_until = min(past.start, self._next + SILENT_AT_ONCE)
        while self._next < silent_until:
            self._drive(self._next, now, publish=False)
        if now < self._not_before or self._next < past.start:
            return []
        self._not_before = now + PAST_PACE_NS
        messages: list[Message] = []
        while self._next < past.stop and len(messages) < MAX_AT_ONCE:
            messages += self._drive(self._next, now, publish=True)
        return messages

    def _drive(self, k: int, now: int, *, publish: bool) -> list[Message]:
        """One time update of the truth; the input's message."""
        if self._tells_truth:
            self._x = self._course.next(k, self._x)
        self._next = k + 1
        if not publish or not self.configuration.base_model.input_count:
            return []
        if not self._tells_truth and not self._course.is_known(k):
            return self._told_missing(k, now)
        return [Input(**self.stamp("input", k, now), u=self._course.input(k).tolist())]

    def _told_missing(self, k: int, now: int) -> list[Message]:
        """An input that nobody knows is not made up; the first one is told."""
        self._missing += 1
        if self._missing > 1:
            return []
        text = f"the recording has no input of step {k}; filters need it, or [model.input_box]"
        return [self.event("WARN", "input-missing", text, now=now, step=k, about={"step": k})]

    def counters(self) -> dict[str, float]:
        return {"missing inputs": float(self._missing)} if self._missing else {}

    def wakeup(self) -> int | None:
        due = None if self.finished else self._schedule.time_of(self._next)
        return None if due is None else max(due, self._not_before, self._pace.ready_at())

    @property
    def finished(self) -> bool:
        return self._last is not None and self._next > self._last

    def step(self) -> int:
        return self._next - 1
