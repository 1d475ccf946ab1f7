"""A simulated plant: publishes the true state and the input of every step."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.mesh.access import PUBLISHES
from lsu_mesh.mesh.config.measurement_files import read_playback
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Input, Message, Truth
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.rate_limit import RateLimit
from lsu_mesh.mesh.nodes.schedule import MAX_AT_ONCE, Schedule
from lsu_mesh.simulation import input_at, next_state, random_uniform

PAST_SECONDS, LEAST_PAST = 30.0, 256
"""So much of the past, and so many steps, a plant that starts late publishes the inputs of: filters need every one."""
PAST_PACE_NS = 4_000_000
"""Between two bursts of past inputs: receivers have to take them besides all else."""
SILENT_AT_ONCE = 20_000
"""Steps of a longer past that are simulated in one tick, in silence."""


class PlantNode(Node):
    """``x⁺ = A x + B u + N w`` with noise and inputs that are functions of (seed, name, step).

    A plant that is started again is at the current step at once, with the same values.
    """

    role = "plant"
    publishes = PUBLISHES["plant"]

    def __init__(self, configuration: Configuration, name: str, boot: str, schedule: Schedule) -> None:
        super().__init__(configuration, name, boot)
        assert configuration.plant is not None
        self._settings = configuration.plant
        self._schedule = schedule
        self._pace = RateLimit(configuration.mesh.rate, configuration.cached)
        self._model = configuration.base_model
        self._last = configuration.mesh.steps
        self._next = 1
        self._not_before = 0
        """When the next burst of past inputs may go out."""
        self._past: range | None = None
        """Steps whose inputs alone are published, because they are over; known with the first tick."""
        self._x: Vector = np.array(
            self._settings.x1 if self._settings.x1 is not None else configuration.prior.center, dtype=np.float64
        )
        self._file: dict[int, Vector] | None = None
        if self._settings.file is not None:
            played = read_playback(self._settings.file, configuration.mesh.dt, configuration.mesh.start_time)
            self._file = dict(zip(played.steps.tolist(), played.values, strict=True))
            end = int(played.steps[-1]) if len(played.steps) else 0
            self._last = end if self._last is None else min(self._last, end)

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return ()

    def warm_up(self) -> None:
        next_state(self._model, self._x, np.zeros(self._model.input_count), np.zeros(self._model.rho.size))

    def receive(self, message: Message, now: int) -> list[Message]:
        return []

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
        u = self._input(k)
        unit = random_uniform(self.configuration.mesh.seed, f"{self.name}/process", k, self._model.rho.size)
        self._x = next_state(self._model, self._x, u, unit)
        self._next = k + 1
        if not publish or not self._model.input_count:
            return []
        return [Input(**self.stamp("input", k, now), u=u.tolist())]

    def _input(self, k: int) -> Vector:
        if self._file is not None:
            u = self._file.get(k)
            return np.zeros(self._model.input_count) if u is None or np.isnan(u).any() else u
        size = self._model.input_count
        return input_at(self._settings.inputs, self.configuration.mesh.seed, k, size=size, name=f"{self.name}/input")

    def wakeup(self) -> int | None:
        due = None if self.finished else self._schedule.time_of(self._next)
        return None if due is None else max(due, self._not_before, self._pace.ready_at())

    @property
    def finished(self) -> bool:
        return self._last is not None and self._next > self._last

    def step(self) -> int:
        return self._next - 1
