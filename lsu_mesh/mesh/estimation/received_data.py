"""What a filter's sensors have sent: whether all of a step has come, what may be used of it, and what may not."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lsu_mesh.array_types import Vector
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.step_data import DataOfSteps, StepData, Unused
from lsu_mesh.mesh.estimation.step_record import Step
from lsu_mesh.mesh.estimation.timeline import Timeline
from lsu_mesh.mesh.measurement_time import is_timed
from lsu_mesh.mesh.messages import Measurement, Reference

MAX_UNUSED = 65536
"""So many measurements that were not used are remembered, to count each once."""


class ReceivedData:
    """Remembers how far each sensor is, and counts what is not used by its reason."""

    def __init__(self, configuration: Configuration, sensors: Sequence[str], timeline: Timeline, kind: str) -> None:
        self._configuration = configuration
        self._timeline = timeline
        self._data = DataOfSteps(configuration, sensors, kind)
        self._newest_timed: dict[str, int] = {}
        """The newest step of each sensor that sends times."""
        self._unused: set[Reference] = set()
        self.counts: dict[str, float] = {}
        """Measurements that were not used, by reason, each once."""

    def note(self, message: Measurement) -> None:
        """Note how far a sensor is."""
        if is_timed(message):
            self._newest_timed[message.name] = max(message.step, self._newest_timed.get(message.name, 0))

    def is_complete(self, k: int, step: Step, sensor: str) -> bool:
        """A datum at t_k, or one of a later step from a sensor that sends times: more of step k will not come."""
        if self._newest_timed.get(sensor, 0) > k:
            return True
        end = self._configuration.grid.time_of(k)
        return any(one.name == sensor and (not is_timed(one) or one.time_ns == end) for one in step.data)

    def missing_input(self, k: int, step: Step, may_take_box: Callable[[], bool]) -> int | None:
        """The first step whose input the data see and must be waited for; the input box may stand in for it."""
        has_box = self._configuration.input_box is not None
        for j in sorted({j for one in step.data for j in self._data.inputs_of(k, one) if j >= k}):
            if not (self._timeline.has_input(j) or self._timeline.input_is_lost(j)):
                return None if has_box and (step.closed or may_take_box()) else j
        return None

    def gather(self, k: int, step: Step, r: Vector) -> StepData:
        """The step's data, for a filter that goes by r (m,); an input box that they see is noted."""
        inputs = self._timeline.inputs
        data = self._data.gather(k, step.data, r, origin=step.origin, known=inputs)
        for unused in data.unused:
            self.count(unused)
        for one in data.data:
            for j in self._data.inputs_of(k, one.message):
                if j not in inputs:
                    self._timeline.sees_box(k, j)
        return data

    def at_start(self, data: StepData) -> StepData:
        """What is left of the data where nothing is known of the step before."""
        return self._data.at_start(data)

    def count(self, unused: Unused) -> None:
        """Count a measurement that is not used, once."""
        if unused.message.reference not in self._unused:
            self._unused.add(unused.message.reference)
            self.counts[unused.reason] = self.counts.get(unused.reason, 0) + 1
            if len(self._unused) > MAX_UNUSED:
                self._unused.clear()
