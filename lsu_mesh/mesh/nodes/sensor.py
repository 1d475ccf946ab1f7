"""Sensors: simulated on the plant's truth, or playing a file of real measurements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import assert_never

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.mesh.access import PUBLISHES, subscriptions
from lsu_mesh.mesh.config.measurement_files import read_playback
from lsu_mesh.mesh.config.settings import Configuration, SensorFault
from lsu_mesh.mesh.messages import Measurement, Message, Truth
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.rate_limit import RateLimit
from lsu_mesh.mesh.nodes.schedule import MAX_AT_ONCE, Schedule
from lsu_mesh.simulation import measure, random_uniform


class SimulatedSensorNode(Node):
    """``y = C x + v`` with v a function of (seed, name, step), and the faults of its configuration."""

    role = "sensor"
    publishes = PUBLISHES["sensor"]

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        super().__init__(configuration, name, boot)
        self._settings = configuration.sensors[name]
        self._step = 0
        self._done: set[int] = set()
        self._stuck: dict[SensorFault, Vector] = {}

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return subscriptions(self.configuration, self.role, self.name)

    def warm_up(self) -> None:
        settings = self._settings
        measure(settings.C, settings.r, np.zeros(len(settings.C[0])), np.zeros(len(settings.r)))

    def receive(self, message: Message, now: int) -> list[Message]:
        if not isinstance(message, Truth) or message.step in self._done:
            return []
        k = message.step
        self._done.add(k)
        self._done -= {old for old in self._done if old < k - 4096} if len(self._done) > 8192 else set()
        self._step = max(self._step, k)
        unit = random_uniform(self.configuration.mesh.seed, f"{self.name}/noise", k, len(self._settings.r))
        y = self._distorted(k, measure(self._settings.C, self._settings.true_r, message.x, unit))
        mesh = self.configuration.mesh
        time_ns = max(0, round(((mesh.start_time or 0.0) + k * mesh.dt) * 1e9))
        return [Measurement(**self.stamp("measurement", k, now), y=listed(y), time_ns=time_ns)]

    def _distorted(self, k: int, y: Vector) -> Vector:
        for fault in self._settings.faults:
            if fault.first <= k <= fault.last:
                y = self._with_fault(fault, k, y)
        return y

    def _with_fault(self, fault: SensorFault, k: int, y: Vector) -> Vector:
        match fault.kind:
            case "bias":
                return y + fault.size
            case "drift":
                return y + fault.size * (k - fault.first + 1)
            case "stuck":
                return self._stuck.setdefault(fault, y)
            case "random":
                noise = random_uniform(self.configuration.mesh.seed, f"{self.name}/fault", k, len(y))
                return y + fault.size * noise
            case "lost":
                return np.full(len(y), math.nan)
            case _:
                assert_never(fault.kind)

    def advance(self, now: int) -> list[Message]:
        return []

    def step(self) -> int:
        return self._step


class FileSensorNode(Node):
    """Plays recorded measurements by their steps; a step between the first and the last without a row is missing.

    An empty cell is a missing output. Rows that share a step with an earlier row are left out and named in an event.
    A sensor that starts late begins with what it would still keep for others, and does not catch up all at once.
    """

    role = "sensor"
    publishes = PUBLISHES["sensor"]

    def __init__(self, configuration: Configuration, name: str, boot: str, schedule: Schedule) -> None:
        super().__init__(configuration, name, boot)
        settings = configuration.sensors[name]
        assert settings.file is not None
        self._schedule = schedule
        mesh = configuration.mesh
        self._played = read_playback(settings.file, mesh.dt, mesh.start_time)
        self._row_of = {int(step): row for row, step in enumerate(self._played.steps)}
        self._size = len(settings.C)
        steps = self._played.steps
        self._next = int(steps[0]) if len(steps) else 1
        self._last = int(steps[-1]) if len(steps) else 0
        if mesh.steps is not None:
            self._last = min(self._last, mesh.steps)
        self._told_collisions = False
        self._pace = RateLimit(mesh.rate, configuration.cached)
        self._has_begun = False
        """Whether a step has been due."""

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return ()

    def receive(self, message: Message, now: int) -> list[Message]:
        return []

    def advance(self, now: int) -> list[Message]:
        messages: list[Message] = []
        if self._played.collisions and not self._told_collisions:
            self._told_collisions = True
            text = (
                f"{self._played.collisions} row(s) share a step with an earlier row and were left out; "
                "a smaller dt keeps them"
            )
            about: dict[str, str | int | float | None] = {"sensor": self.name, "rows": self._played.collisions}
            messages.append(self.event("WARN", "rows-share-a-step", text, now=now, step=self._next, about=about))
        due = min(self._schedule.due(now), self._last)
        if not self._has_begun and due:
            self._has_begun = True
            kept = self.configuration.cached
            self._next = max(self._next, due + 1 - kept)  # what came before would be too late for everybody
        steps = self._pace.take(min(MAX_AT_ONCE, due + 1 - self._next), now)
        messages += [self._measurement(k, now) for k in range(self._next, self._next + steps)]
        self._next += steps
        return messages

    def _measurement(self, k: int, now: int) -> Measurement:
        row = self._row_of.get(k)
        y: list[float | None] = [None] * self._size if row is None else listed(self._played.values[row])
        time_ns = int(self._played.time_ns[row]) if row is not None else 0
        if not time_ns:
            mesh = self.configuration.mesh
            time_ns = max(0, round(((mesh.start_time or 0.0) + k * mesh.dt) * 1e9))
        return Measurement(**self.stamp("measurement", k, now), y=y, time_ns=time_ns)

    def wakeup(self) -> int | None:
        due = None if self.finished else self._schedule.time_of(self._next)
        return None if due is None else max(due, self._pace.ready_at())

    @property
    def finished(self) -> bool:
        return self._next > self._last

    def step(self) -> int:
        return self._next - 1


def listed(y: Vector) -> list[float | None]:
    """Numbers for a message, nil where missing."""
    return [None if math.isnan(value) else value for value in y.tolist()]
