"""The data of one step: which of them may be used, each with its moment, its half-widths and the inputs that it sees.

Nothing here depends on the order in which messages came: the same messages, set before and inputs give the same data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.grid import grid_half_widths
from lsu_mesh.filters.held_inputs import HeldInputs
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.filters.timed_data import TimedDatum, cut
from lsu_mesh.mesh.config.settings import Configuration, SensorSettings
from lsu_mesh.mesh.estimation.time_update import Origin
from lsu_mesh.mesh.measurement_time import goes_to_nearest, tolerance_ns
from lsu_mesh.mesh.messages import Input, Measurement, Reference
from lsu_mesh.mesh.time_requirements import ONE_UPDATE
from lsu_mesh.model import ContinuousModel

BEFORE_PRIOR = "before the prior"
AT_A_START = "off the grid at a start"
ACROSS_MODELS = "time error across a change of the model"
NO_INPUT = "input not known"
ONE_PER_STEP = "more than one of a step"
"""Reasons for which a datum is not used, by which it is counted."""


Values = Callable[[int], Drive]
"""The input of a step, or the box that holds it; ``None`` where neither is known."""
Beginnings = Callable[[int], tuple[int, int]]
"""When the input of a step begins to act, in ns, and how much later at most."""


class Datum(NamedTuple):
    """One message with its moment."""

    message: Measurement
    timed: TimedDatum


class Unused(NamedTuple):
    """A message that is not used, and why."""

    message: Measurement
    reason: str


@dataclass(frozen=True, eq=False)
class StepData:
    """What a filter is given of step k. ``data`` are in their order; ``y`` holds them where one update takes them all.

    origin: the posterior of step k − 1, ``None`` at a start. flow: the continuous model between the two steps.
    """

    k: int
    start_ns: int
    end_ns: int
    data: tuple[Datum, ...]
    y: Vector | None
    r: Vector | None
    u: Drive
    """What acts from t_k on, where an output sees it."""
    inputs: HeldInputs
    origin: Origin | None = None
    flow: ContinuousModel | None = None
    seen: tuple[Reference, ...] = ()
    """Inputs that data see, besides the one that drove the step before."""
    unused: tuple[Unused, ...] = ()
    silent: frozenset[str] = frozenset()
    """Sensors that have sent only nil."""

    @property
    def inside(self) -> list[Datum]:
        """The data between the steps."""
        return [] if self.y is not None else [one for one in self.data if one.timed.time_ns < self.end_ns]

    @property
    def at_end(self) -> list[Datum]:
        """The data at t_k."""
        return [one for one in self.data if self.y is not None or one.timed.time_ns >= self.end_ns]

    def has(self, sensor: str) -> bool:
        """Whether the sensor was there."""
        return sensor in self.silent or any(one.message.name == sensor for one in self.data)

    def update(self, engine: Filter, factor: float = 1.0) -> None:
        """Data update with all data at t_k, r widened; ``InconsistentData``, and the engine is where it was."""
        if self.y is not None:
            r = self.r if factor == 1.0 else factor * (engine.model.r if self.r is None else self.r)
            if not np.isnan(self.y).all():
                update(engine, self.y, r, self.u)
            return
        before = engine.snapshot()
        try:
            for one in self.at_end:
                self.cut(engine, one.timed, factor)
        except InconsistentData:
            engine.restore(before)
            raise

    def cut(self, engine: Filter, datum: TimedDatum, factor: float = 1.0) -> None:
        """Data update of a set of the datum's moment, r widened; one whose time error is too long says nothing."""
        if factor != 1.0:
            assert datum.r is not None
            datum = replace(datum, r=factor * datum.r)
        if self.flow is None:
            engine.update(datum.y, datum.r, model=datum.outputs, u=self.u)
        else:
            cut(engine, self.flow, datum, self.inputs)

    def agrees(self, engine: Filter) -> bool:
        """Whether the data at t_k are not proved to miss the engine's set; it stays as it is."""
        before = engine.snapshot()
        try:
            self.update(engine)
        except InconsistentData:
            return False
        engine.restore(before)
        return True


def update(engine: Filter, y: Vector, r: Vector | None, u: Drive) -> None:
    """Data update with y (m,); filters of other packages need not know of u where no output sees an input."""
    if u is None:
        engine.update(y, r)
    else:
        engine.update(y, r, u=u)


class DataOfSteps:
    """Makes the data of the steps of one filter, of this kind, from what its sensors have sent."""

    def __init__(self, configuration: Configuration, sensors: Sequence[str], kind: str) -> None:
        self._configuration = configuration
        self._sensors = sensors
        self._one_each = kind in ONE_UPDATE
        self._outputs = {name: configuration.model([name]) for name in sensors}
        self._rows: dict[str, slice] = {}
        start = 0
        for name in sensors:
            self._rows[name] = slice(start, start + self._outputs[name].output_count)
            start = self._rows[name].stop
        self._sees_inputs = configuration.base_model.input_count > 0

    def inputs_of(self, k: int, message: Measurement) -> range:
        """The steps whose inputs a datum of step k sees, by its feedthrough or by the error of its time."""
        sensor = self._configuration.sensors[message.name]
        error = message.time_error_ns or 0
        if not self._sees_inputs or not (sensor.D or (error and self._configuration.continuous is not None)):
            return range(0)
        if self._configuration.continuous is None:
            is_widened = message.time_error_ns is not None and self._is_off(k, message, sensor)
            return range(k - 1 if is_widened and sensor.rate else k, k + 1)
        time, delay = self._time(k, message), self._configuration.input_delay_ns
        return range(self._acting(time - error - delay), self._acting(time + error) + 1)

    def gather(
        self, k: int, messages: Iterable[Measurement], r: Vector, *, origin: Origin | None, known: Mapping[int, Input]
    ) -> StepData:
        """The data of step k; r (m,) are the filter's half-widths, ``known`` the inputs that have come."""
        grid, has_flow = self._configuration.grid, self._configuration.continuous is not None
        listed = list(messages)
        told = [message for message in listed if any(value is not None for value in message.y)]
        value, begins = self._values(k, origin, known), self._beginnings(k, origin, known)
        found: list[Datum] = []
        unused: list[Unused] = []
        for message in told:
            reason = self._refusal(k, message, origin is not None, value=value)
            if reason:
                unused.append(Unused(message, reason))
            else:
                found.append(Datum(message, self._timed(k, message, r, value=value)))
        found.sort(key=lambda one: one.timed.order)
        found, spare = self._first_of_each(found)
        needed = sorted({j for one in found for j in self.inputs_of(k, one.message)})
        before = [] if origin is None or origin.earlier is None else [k - 2]
        inputs = self._held({*needed, *before, k - 1} if has_flow else set(), value, begins)
        at_end = inputs.hull(grid.time_of(k), grid.time_of(k)) if has_flow else value(k)
        data = StepData(
            k=k, start_ns=grid.time_of(k - 1), end_ns=grid.time_of(k), data=tuple(found), y=None, r=None,
            u=at_end if k in needed else None, inputs=inputs,
            origin=origin, flow=self._configuration.flow(k - 1),
            seen=tuple(known[j].reference for j in needed if j in known and not self._is_of_origin(j, k, origin)),
            unused=(*unused, *spare),
            silent=frozenset(one.name for one in listed if one not in told) - {one.message.name for one in found},
        )  # fmt: skip
        return self._stacked(data) if self._is_plain(data) else data

    def at_start(self, data: StepData) -> StepData:
        """What is left of the data where nothing is known of the step before."""
        if data.origin is None:
            return data
        kept = tuple(one for one in data.data if one.timed.time_ns == data.end_ns and one.timed.error_ns == 0)
        left = replace(data, data=kept, origin=None, y=None, r=None)
        return self._stacked(left) if self._is_plain(left) else left

    # -- one datum

    def _refusal(self, k: int, message: Measurement, has_origin: bool, *, value: Values) -> str:
        configuration = self._configuration
        time, error = self._time(k, message), message.time_error_ns or 0
        first, end = configuration.grid.time_of(1), configuration.grid.time_of(k)
        is_on_grid = error == 0 and time == end
        sensor = configuration.sensors[message.name]
        is_nearest = goes_to_nearest(configuration, sensor)
        if message.step < 1 or (not is_on_grid and not is_nearest and time - error < first):
            return BEFORE_PRIOR
        if configuration.continuous is not None and not is_on_grid:
            if not has_origin:
                return AT_A_START
            spanned = range(self._acting(time - error), self._acting(time + error) + 1) if error else range(0)
            if any(configuration.flow(j) is not configuration.flow(k - 1) for j in spanned):
                return ACROSS_MODELS
        return NO_INPUT if any(value(j) is None for j in self.inputs_of(k, message)) else ""

    def _timed(self, k: int, message: Measurement, r: Vector, *, value: Values) -> TimedDatum:
        configuration, sensor = self._configuration, self._configuration.sensors[message.name]
        widths = r[self._rows[message.name]]
        time, error = self._time(k, message), message.time_error_ns or 0
        if configuration.continuous is None and message.time_error_ns is not None:
            sees = self.inputs_of(k, message)
            widths = grid_half_widths(
                self._outputs[message.name], widths, message.time_ns, error_ns=error,
                step_ns=configuration.grid.time_of(k), tolerance_ns=tolerance_ns(sensor),
                rate=sensor.rate or None, off_grid=sensor.off_grid,
                inputs=(value(k - 1), value(k)) if len(sees) == 2 else None,
            )  # fmt: skip
        return TimedDatum(
            time_ns=time if configuration.continuous is not None else configuration.grid.time_of(k),
            y=np.array([np.nan if entry is None else entry for entry in message.y]),
            error_ns=error if configuration.continuous is not None else 0,
            outputs=self._outputs[message.name],
            r=widths,
            sensor=message.name,
        )

    def _time(self, k: int, message: Measurement) -> int:
        """When it was made: at its step where it does not say, or within the tolerance of a discrete model."""
        if message.time_error_ns is None:
            return self._configuration.grid.time_of(k)
        if self._configuration.continuous is None:
            sensor = self._configuration.sensors[message.name]
            if not self._is_off(k, message, sensor):
                return self._configuration.grid.time_of(k)
        return message.time_ns

    def _is_off(self, k: int, message: Measurement, sensor: SensorSettings) -> bool:
        return bool(message.time_error_ns) or (
            abs(message.time_ns - self._configuration.grid.time_of(k)) > tolerance_ns(sensor)
        )

    # -- inputs

    def _acting(self, time_ns: int) -> int:
        """The step whose input acts from a moment on."""
        grid = self._configuration.grid
        j = grid.step_of(time_ns)
        return j if grid.time_of(j) == time_ns else j - 1

    def _values(self, k: int, origin: Origin | None, known: Mapping[int, Input]) -> Values:
        box = self._configuration.input_box

        def value(j: int) -> Drive:
            if origin is not None and self._is_of_origin(j, k, origin):
                return origin.u if j == k - 1 else box if origin.earlier is None else origin.earlier
            return np.array(known[j].u) if j in known else box

        return value

    def _is_of_origin(self, j: int, k: int, origin: Origin | None) -> bool:
        """Whether the set was carried from step k − 1 with the input of step j, or with the box in its place."""
        return origin is not None and (j == k - 1 or (j == k - 2 and self._configuration.input_delay_ns > 0))

    def _beginnings(self, k: int, origin: Origin | None, known: Mapping[int, Input]) -> Beginnings:
        grid, delay = self._configuration.grid, self._configuration.input_delay_ns

        def begins(j: int) -> tuple[int, int]:
            is_told = j in known and not (j == k - 2 and origin is not None and origin.earlier is None)
            since = known[j].time_ns if is_told else None
            if origin is not None and j == k - 1:
                since = origin.since
            return (grid.time_of(j), delay) if since is None else (since, 0)

        return begins

    def _held(self, steps: set[int], value: Values, begins: Beginnings) -> HeldInputs:
        """The inputs of these steps, and of those between them, at their times."""
        if not self._sees_inputs or not steps:
            return HeldInputs.constant()
        listed = range(min(steps), max(steps) + 1)
        times, delays = zip(*map(begins, listed), strict=True)
        values = [value(j) for j in listed]
        return HeldInputs(times, values, before=self._configuration.input_box, delay_ns=delays)

    # -- all of a step in one update

    def _first_of_each(self, found: list[Datum]) -> tuple[list[Datum], list[Unused]]:
        if not self._one_each:
            return found, []
        first: dict[str, Datum] = {}
        for one in found:
            first.setdefault(one.message.name, one)
        kept = [one for one in found if first[one.message.name] is one]
        return kept, [Unused(one.message, ONE_PER_STEP) for one in found if first[one.message.name] is not one]

    def _is_plain(self, data: StepData) -> bool:
        """Whether one update takes all data: one of each sensor, at t_k, or moved there by declaration."""
        names = [one.message.name for one in data.data]
        is_discrete = self._configuration.continuous is None
        on_grid = all(one.timed.time_ns == data.end_ns and one.timed.error_ns == 0 for one in data.data)
        return len(set(names)) == len(names) and (is_discrete or on_grid)

    def _stacked(self, data: StepData) -> StepData:
        """The data by sensor, then row; NaN where missing."""
        by_name = {one.message.name: one for one in data.data}
        y: list[Vector] = []
        r: list[Vector] = []
        is_usual = True
        for name in self._sensors:
            one, outputs = by_name.get(name), self._outputs[name]
            y.append(np.full(outputs.output_count, np.nan) if one is None else one.timed.y)
            r.append(outputs.r if one is None or one.timed.r is None else one.timed.r)
            is_usual &= one is None or one.message.time_error_ns is None or self._is_usual(data.k, one)
        in_order = tuple(by_name[name] for name in self._sensors if name in by_name)
        return replace(
            data, data=in_order, y=np.concatenate([np.zeros(0), *y]), r=None if is_usual else np.concatenate(r)
        )

    def _is_usual(self, k: int, one: Datum) -> bool:
        """Whether the filter's own r holds for a datum."""
        sensor = self._configuration.sensors[one.message.name]
        return not sensor.rate or not self._is_off(k, one.message, sensor)
