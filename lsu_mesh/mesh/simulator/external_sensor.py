"""Programs of others in a simulated mesh: sensors with clocks of their own, which are set, jump, and start again."""

from __future__ import annotations

import functools
import random
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.mesh.config.settings import Configuration, PlantSettings
from lsu_mesh.mesh.messages import Measurement, Message
from lsu_mesh.mesh.nodes.node import SECOND, Node
from lsu_mesh.mesh.nodes.plant_course import PlantCourse
from lsu_mesh.mesh.nodes.sensor import listed
from lsu_mesh.simulation import measured

LEAST_STEP_NS, MAX_STEP_NS = 10 * SECOND, 3600 * SECOND
"""A clock that is set wrong by less tells false times, which only ``time_error`` can declare."""
MAX_CLOCK_STEPS = 3
PAUSES = (0.3, 1.0, 1.7, 6.0)
"""Mean time between two measurements, in steps of the mesh."""
MIN_OFF_NS, MAX_OFF_NS = SECOND // 2, 4 * SECOND
"""How long a clock stays wrong."""


@dataclass(frozen=True)
class ClockStep:
    """A sensor's clock is wrong by ``offset_ns`` from ``begin`` to ``end`` (nanoseconds of true time)."""

    begin: int
    end: int
    offset_ns: int


def draw_clock_steps(
    rng: random.Random, names: Collection[str], begin: int, end: int
) -> Mapping[str, Sequence[ClockStep]]:
    """Clocks that jump by 10 s to an hour, forth or back, and are set right again before ``end``."""
    found = {}
    for name in sorted(names):
        steps = []
        for _ in range(rng.randint(0, MAX_CLOCK_STEPS)):
            first = rng.randint(begin, max(begin, end - MIN_OFF_NS))
            size = round(LEAST_STEP_NS * (MAX_STEP_NS / LEAST_STEP_NS) ** rng.random())
            last = min(end, first + rng.randint(MIN_OFF_NS, MAX_OFF_NS))
            steps.append(ClockStep(first, last, size * rng.choice((-1, 1))))
        found[name] = tuple(steps)
    return found


def with_simulated_plant(configuration: Configuration, start_ns: int) -> Configuration:
    """The mesh of live sources with t_0 known, and a plant that moves what they measure."""
    plant = configuration.plant
    if plant is None:
        plant = PlantSettings("plant", None, "normal", None)
    return replace(configuration.started(start_ns), plant=plant)


@functools.lru_cache(maxsize=8)
def course_states(configuration_key: _Keyed, steps: int) -> NDArray[np.float64]:
    """The states of steps 1 … T (T, n), kept for the sensors of one mesh."""
    course = PlantCourse(configuration_key.configuration)
    X = np.empty((steps, course.first.size))
    X[0] = course.first
    for k in range(1, steps):
        X[k] = course.next(k, X[k - 1])
    return X


class _Keyed:
    """A configuration as a key: the same object."""

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration

    def __hash__(self) -> int:
        return id(self.configuration)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Keyed) and other.configuration is self.configuration


class ExternalSensor(Node):
    """A program that measures when it likes and sends times, not steps; ``now`` is the true time.

    Parameters
    ----------
    clock_steps:
        When its clock, and so every stamp that it writes, is wrong.
    steps:
        How far the plant goes.
    """

    role = "sensor"
    publishes = ("measurement",)

    def __init__(
        self, configuration: Configuration, name: str, boot: str, *, clock_steps: Sequence[ClockStep], steps: int
    ) -> None:
        super().__init__(configuration, name, boot)
        self._outputs = configuration.model([name])
        self._course, self._X = PlantCourse(configuration), course_states(_Keyed(configuration), steps)
        self._clock_steps = clock_steps
        self._rng = random.Random(f"{configuration.mesh.seed}/{name}/{boot}")
        self._pause_ns = configuration.mesh.dt * SECOND * random.Random(f"{name}").choice(PAUSES)
        self._next: int | None = None
        self.told_wrong = 0
        """Data that were stamped by a wrong clock."""

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return ()

    def receive(self, message: Message, now: int) -> list[Message]:
        return []

    def advance(self, now: int) -> list[Message]:
        if self._next is None or now >= self._next:
            is_first = self._next is None
            self._next = now + max(1, int(self._pause_ns * self._rng.uniform(0.5, 1.5)))
            return [] if is_first else self._measured(now)
        return []

    def _measured(self, now: int) -> list[Message]:
        grid = self.configuration.grid
        k = grid.step_of(now)
        k = k if grid.time_of(k) == now else k - 1
        if not k >= 1 or now > grid.time_of(len(self._X) - 1):
            return []
        offset = self.offset(now)
        self.told_wrong += offset != 0
        x = self._course.after(k, self._X[k - 1], now - grid.time_of(k))
        unit = np.array([self._rng.uniform(-1.0, 1.0) for _ in range(self._outputs.output_count)])
        y = measured(self._outputs, x, self._course.input(k), unit)
        stamped = now + offset
        return [
            Measurement(
                **self.stamp("measurement", 0, stamped), y=listed(y), time_ns=stamped,
                time_error_ns=self.configuration.sensors[self.name].time_error_ns,
            )
        ]  # fmt: skip

    def offset(self, at: int) -> int:
        """How wrong the clock is, in ns: the last setting counts, as sums of two could be small and be believed."""
        wrong = [step for step in self._clock_steps if step.begin <= at < step.end]
        return max(wrong, key=lambda step: step.begin).offset_ns if wrong else 0

    def wakeup(self) -> int | None:
        return self._next
