"""A plant of N targets: publishes the true states of all of them, one message per step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Matrix
from lsu_mesh.bank_simulation import BankDynamics
from lsu_mesh.mesh.access import published_topics, truth_is_known
from lsu_mesh.mesh.bank_messages import BankTruth, packed
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Message
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.rate_limit import RateLimit
from lsu_mesh.mesh.nodes.schedule import GridSchedule, Schedule
from lsu_mesh.simulation import random_uniform

MAX_AT_ONCE = 4
"""Steps that are published in one tick at most."""
SILENT_AT_ONCE = 512
"""Steps of a past that are simulated in one tick, in silence."""


class BankPlantNode(Node):
    """States that are functions of (seed, name, step): a plant that starts again is at the current step with the same.

    x_1 of an instance is that of ``[model.instances] x1``, else uniform in its prior.
    """

    role = "plant"

    def __init__(self, configuration: Configuration, name: str, boot: str, schedule: Schedule | GridSchedule) -> None:
        self.publishes = published_topics(configuration, self.role, name)
        super().__init__(configuration, name, boot)
        assert configuration.instances is not None
        self._schedule = schedule
        self._count = configuration.instances.count
        self._dynamics = BankDynamics(configuration.instances.models(configuration.base_model))
        self._last = configuration.mesh.steps if truth_is_known(configuration) else 0
        self._pace = RateLimit(configuration.mesh.rate, configuration.cached)
        self._next = 1
        self._x = first_states(configuration, name)

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return ()

    def receive(self, message: Message, now: int) -> list[Message]:
        return []

    def warm_up(self) -> None:
        self._moved(1, self._x)

    def record_links(self, count: int, now: int) -> None:
        super().record_links(count, now)
        self._pace.record_links(count, now)

    def advance(self, now: int) -> list[Message]:
        due = self._schedule.due(now)
        if self._last is not None:
            due = min(due, self._last)
        if due < self._next:
            return []
        silent = max(0, due + 1 - self._next - self.configuration.cached)
        if silent:
            for _ in range(min(silent, SILENT_AT_ONCE)):
                self._advance_state()
            return []
        messages: list[Message] = []
        for k in range(self._next, self._next + self._pace.take(min(MAX_AT_ONCE, due + 1 - self._next), now)):
            messages.append(BankTruth(**self.stamp("bank_truth", k, now), instances=self._count, x=packed(self._x)))
            self._advance_state()
        return messages

    def _advance_state(self) -> None:
        self._x = self._moved(self._next, self._x)
        self._next += 1

    def _moved(self, k: int, x: Matrix) -> Matrix:
        size = (self._count, self._dynamics.noise_count)
        unit = random_uniform(self.configuration.mesh.seed, f"{self.name}/process", k, size[0] * size[1])
        return self._dynamics.next_states(x, unit.reshape(size))

    def wakeup(self) -> int | None:
        due = None if self.finished else self._schedule.time_of(self._next)
        return None if due is None else max(due, self._pace.ready_at())

    @property
    def finished(self) -> bool:
        return self._last is not None and self._next > self._last

    def step(self) -> int:
        return self._next - 1


def first_states(configuration: Configuration, plant: str) -> Matrix:
    """x_1 (N, n) of all instances."""
    instances, prior = configuration.instances, configuration.prior
    assert instances is not None
    if instances.x1 is not None:
        return instances.x1
    lower = np.broadcast_to(prior.lower if instances.lower is None else instances.lower, (instances.count, prior.dim))
    upper = np.broadcast_to(prior.upper if instances.upper is None else instances.upper, (instances.count, prior.dim))
    unit = random_uniform(configuration.mesh.seed, f"{plant}/first", 1, lower.size).reshape(lower.shape)
    middle, radius = 0.5 * lower + 0.5 * upper, 0.5 * upper - 0.5 * lower
    return np.clip(middle + unit * radius, lower, upper)
