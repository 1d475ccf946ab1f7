"""Sensors that are simulated on the plant's truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, assert_never

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.mesh.access import PUBLISHES, subscriptions
from lsu_mesh.mesh.config.settings import Configuration, SensorFault
from lsu_mesh.mesh.measurement_time import step_of
from lsu_mesh.mesh.messages import Measurement, Message, Truth
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.plant_course import PlantCourse
from lsu_mesh.mesh.nodes.sensor_clock import Moment, SensorClock
from lsu_mesh.mesh.nodes.time_fields import time_fields
from lsu_mesh.simulation import measured, random_uniform

REMEMBERED = 4096
"""Steps whose truth was seen."""


class State(NamedTuple):
    """x_k."""

    step: int
    x: Vector


class SimulatedSensorNode(Node):
    """``y = C x + D u + d + v`` with v a function of (seed, name, number), and the faults of its configuration.

    It measures at every step, or at moments of its own (:class:`SensorClock`). The state between t_k and t_{k+1} is
    that of :class:`PlantCourse` from the truth of step k on, and what was measured there is told with the next truth.
    """

    role = "sensor"
    publishes = PUBLISHES["sensor"]

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        super().__init__(configuration, name, boot)
        settings = configuration.sensors[name]
        self._settings = settings
        self._outputs = configuration.model([name]).replace(r=settings.true_r)
        self._clock = SensorClock(settings, configuration.grid, configuration.mesh.seed)
        needs_course = self._outputs.D is not None or not self._clock.is_on_grid
        self._course = PlantCourse(configuration) if needs_course else None
        self.messages_per_step = 1 if self._clock.is_on_grid else self._clock.most_per_step
        self._newest: State | None = None
        self._done: set[int] = set()
        self._stuck: dict[SensorFault, Vector] = {}

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return subscriptions(self.configuration, self.role, self.name)

    def warm_up(self) -> None:
        model = self._outputs
        x, u, unit = np.zeros(model.state_count), np.zeros(model.input_count), np.zeros(model.output_count)
        measured(model, x, u, unit)
        if self._course is not None:
            self._course.after(1, self._course.first, 1)

    def receive(self, message: Message, now: int) -> list[Message]:
        if not isinstance(message, Truth) or message.step in self._done:
            return []
        k = message.step
        self._done.add(k)
        self._done -= {old for old in self._done if old < k - REMEMBERED} if len(self._done) > 2 * REMEMBERED else set()
        state = State(k, np.array(message.x))
        if self._clock.is_on_grid:
            at = self.configuration.grid.time_of(k)
            self._remember(state)
            return [self._measurement(state, Moment(k, at, at), now)]
        return self._measurements_by(state, now)

    def step(self) -> int:
        return 0 if self._newest is None else self._newest.step

    def advance(self, now: int) -> list[Message]:
        return []

    def _remember(self, state: State) -> None:
        if self._newest is None or state.step > self._newest.step:
            self._newest = state

    def _measurements_by(self, state: State, now: int) -> list[Message]:
        """What was measured since the last truth, and at this one's moment; all up to the next one if that is known."""
        grid, before = self.configuration.grid, self._newest
        at, end = grid.time_of(state.step), grid.time_of(state.step + 1)
        if before is not None and state.step < before.step:
            return self._measured_between(state, at, end, now)
        found: list[Message] = []
        if before is not None:
            known = grid.time_of(before.step)
            found = self._measured_between(before, known + 1, grid.time_of(before.step + 1), now)
        self._remember(state)
        return [*found, *self._measured_between(state, at, at + 1, now)]

    def _measured_between(self, state: State, first_ns: int, last_ns: int, now: int) -> list[Message]:
        """The moments in ``[first_ns, last_ns)`` whose stamps lie inside the run."""
        grid, last = self.configuration.grid, self.configuration.mesh.steps
        return [
            self._measurement(state, moment, now)
            for moment in self._clock.between(first_ns, last_ns)
            if grid.time_of(1) <= moment.stamp_ns and (last is None or moment.stamp_ns <= grid.time_of(last))
        ]

    def _measurement(self, state: State, moment: Moment, now: int) -> Measurement:
        grid, model, seed = self.configuration.grid, self._outputs, self.configuration.mesh.seed
        x, u, since = state.x, np.zeros(model.input_count), moment.time_ns - grid.time_of(state.step)
        if self._course is not None:
            u = self._course.input(state.step)
            x = self._course.after(state.step, x, since) if since else x
        unit = random_uniform(seed, f"{self.name}/noise", moment.number, model.output_count)
        k = step_of(self.configuration, self._settings, moment.stamp_ns)
        y = self._distorted(k, moment.number, measured(model, x, u, unit))
        fields = time_fields(grid, moment.stamp_ns, self._settings.time_error_ns)
        return Measurement(**self.stamp("measurement", k, now), y=listed(y), **fields)

    def _distorted(self, k: int, number: int, y: Vector) -> Vector:
        for fault in self._settings.faults:
            if fault.first <= k <= fault.last:
                y = self._with_fault(fault, k, number, y=y)
        return y

    def _with_fault(self, fault: SensorFault, k: int, number: int, *, y: Vector) -> Vector:
        match fault.kind:
            case "bias":
                return y + fault.size
            case "drift":
                return y + fault.size * (k - fault.first + 1)
            case "stuck":
                return self._stuck.setdefault(fault, y)
            case "random":
                noise = random_uniform(self.configuration.mesh.seed, f"{self.name}/fault", number, len(y))
                return y + fault.size * noise
            case "lost":
                return np.full(len(y), math.nan)
            case _:
                assert_never(fault.kind)


def listed(y: Vector) -> list[float | None]:
    """Numbers for a message, nil where missing."""
    return [None if math.isnan(value) else value for value in y.tolist()]
