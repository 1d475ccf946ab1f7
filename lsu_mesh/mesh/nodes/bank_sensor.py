"""A simulated sensor of N targets: measures all of them, one message per step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Matrix
from lsu_mesh.bank_simulation import measured_rows
from lsu_mesh.mesh.access import published_topics, subscriptions
from lsu_mesh.mesh.bank_messages import BankMeasurement, BankTruth, packed
from lsu_mesh.mesh.config.settings import Configuration, SensorFault
from lsu_mesh.mesh.messages import Message
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.time_fields import time_fields
from lsu_mesh.simulation import random_uniform

REMEMBERED = 4096
"""Steps whose truth was seen."""


class BankSensorNode(Node):
    """``y = C x + v`` of every instance, v a function of (seed, name, step); faults may be those of some instances."""

    role = "sensor"

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        self.publishes = published_topics(configuration, self.role, name)
        super().__init__(configuration, name, boot)
        self._settings = settings = configuration.sensors[name]
        self._C = np.array(settings.C, dtype=np.float64)
        self._r = np.array(settings.true_r, dtype=np.float64)
        self._newest = 0
        self._done: set[int] = set()
        self._stuck: dict[SensorFault, Matrix] = {}

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return subscriptions(self.configuration, self.role, self.name)

    def receive(self, message: Message, now: int) -> list[Message]:
        """Measure a truth; of two publishers, or of a plant that started again, the first of a step counts."""
        if not isinstance(message, BankTruth) or message.step in self._done:
            return []
        k = message.step
        self._newest = max(self._newest, k)
        self._done.add(k)
        if len(self._done) > 2 * REMEMBERED:
            self._done = {step for step in self._done if step > self._newest - REMEMBERED}
        X, seed = message.matrix("x"), self.configuration.mesh.seed
        unit = random_uniform(seed, f"{self.name}/noise", k, len(X) * len(self._C)).reshape(len(X), -1)
        Y = measured_rows(self._C, self._r, X, unit)
        for fault in self._settings.faults:
            if fault.first <= k <= fault.last:
                Y = self._with_fault(fault, k, Y)
        grid = self.configuration.grid
        fields = time_fields(grid, grid.time_of(k), self._settings.time_error_ns)
        stamp = self.stamp("bank_measurement", k, now)
        return [BankMeasurement(**stamp, instances=len(Y), y=packed(Y), **fields)]

    def _with_fault(self, fault: SensorFault, k: int, Y: Matrix) -> Matrix:
        rows = list(fault.instances) or slice(None)
        changed = Y.copy()
        if fault.kind == "bias":
            changed[rows] += fault.size
        elif fault.kind == "drift":
            changed[rows] += fault.size * (k - fault.first + 1)
        elif fault.kind == "stuck":
            changed[rows] = self._stuck.setdefault(fault, Y[rows].copy())
        elif fault.kind == "random":
            noise = random_uniform(self.configuration.mesh.seed, f"{self.name}/fault", k, Y.size).reshape(Y.shape)
            changed[rows] += fault.size * noise[rows]
        else:
            changed[rows] = np.nan
        return changed

    def advance(self, now: int) -> list[Message]:
        return []

    def step(self) -> int:
        return self._newest
