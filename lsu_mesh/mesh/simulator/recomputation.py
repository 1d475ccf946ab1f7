"""Whether a measurement that came late is in the set of its step: the set is computed again without the node.

Only for filters whose message holds all that they know (orthotopes and parallelotopes) and that take no transfers, in a
mesh whose inputs act at their steps and are seen by no output. Data with moments of their own are brought in by the
library's walk, one after another; what a discrete model widens, by the library too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.grid import grid_half_widths
from lsu_mesh.filters.held_inputs import HeldInputs
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.filters.timed_data import TimedDatum, bring, cut, ordered
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.measurement_time import tolerance_ns
from lsu_mesh.mesh.messages import Input, Measurement, Message, Posterior
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.sets import to_message, to_support
from lsu_mesh.mesh.simulator.broken import InvariantBroken
from lsu_mesh.model import LSUModel

KINDS = ("LSUO", "LSUP")


class Recomputation:
    """Remembers, per life of a filter, its measurements and inputs, and which steps got something late."""

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._engines: dict[str, Filter] = {}
        self._inputs: dict[tuple[str, int], Input] = {}
        self._measured: dict[tuple[str, int], list[Measurement]] = {}
        self._late: dict[str, set[int]] = {}
        self._watched = {
            name
            for name, settings in configuration.filters.items()
            if settings.kind in KINDS and settings.transfer == "off" and _is_simple(configuration)
        }

    def admitted(self, node: Node, message: Message) -> None:
        """A filter has taken a message."""
        if node.name not in self._watched or not isinstance(node, FilterNode):
            return
        current = node.current
        if current is not None and message.step < current - node.history:
            return  # too late: the node takes no notice of it either
        if isinstance(message, Input):
            self._inputs.setdefault((node.boot, message.step), message)
        elif isinstance(message, Measurement):
            listed = self._measured.setdefault((node.boot, message.step), [])
            if not any(_is_copy(one, message) for one in listed):
                listed.append(message)
            if current is not None and message.step <= current:
                self._late.setdefault(node.boot, set()).add(message.step)

    def check(self, node: Node, newest: dict[int, Posterior]) -> None:
        """The newest set of each step that got something late is what its data make of the set before.

        A step that the node has still to do again waits: the data may await an input that they see.
        """
        late = self._late.pop(node.boot, set())
        if isinstance(node, FilterNode) and node.current is not None:
            waiting = {k for k in late if not node.timeline.is_over(k)}
            if waiting:
                self._late[node.boot] = waiting
                late -= waiting
        for k in sorted(late):
            before, found = newest.get(k - 1), newest.get(k)
            if before is None or found is None or {before.boot, found.boot} != {node.boot}:
                continue
            if found.status == "restarted" or self._reaches_before_the_prior(node.boot, k):
                continue
            text = f"{found.src} step {k} revision {found.revision}: its data make another set of step {k - 1}"
            try:
                expected = self._computed(node, k, before)
            except InconsistentData as error:
                raise InvariantBroken("late data", f"{text}: {error}") from None
            if to_message(expected.support) != found.support:
                raise InvariantBroken("late data", text)

    def _reaches_before_the_prior(self, boot: str, k: int) -> bool:
        first = self._configuration.grid.time_of(1)
        return any(one.time_error_ns is not None and one.time_ns - one.time_error_ns < first
                   for one in self._measured.get((boot, k), ()))  # fmt: skip

    # -- the set again

    def _computed(self, node: Node, k: int, before: Posterior) -> Filter:
        engine, measured = self._engine(node.name), self._measured.get((node.boot, k), [])
        data = ordered(self._datum(k, one) for one in measured if any(value is not None for value in one.y))
        start, end = self._configuration.grid.time_of(k - 1), self._configuration.grid.time_of(k)
        engine.resume(to_support(before.support), np.array(before.lower), np.array(before.upper))
        at_end = [one for one in data if one.time_ns == end]
        is_plain = len({one.sensor for one in data}) == len(data) == len(at_end) and not any(
            one.error_ns for one in data
        )
        flow, inputs = self._configuration.flow(k - 1), self._held(node.boot, k)
        if flow is None or not any(one.time_ns < end for one in data):
            engine.predict(inputs.at(start), model=self._model(k - 1))
        else:
            bring(engine, flow, [one for one in data if one.time_ns < end], start, end_ns=end, inputs=inputs)
        if is_plain:
            self._update_at_once(engine, node.name, data)
            return engine
        for one in at_end:
            if flow is None:
                engine.update(one.y, one.r, model=one.outputs)
            else:
                cut(engine, flow, one, inputs)
        return engine

    def _engine(self, name: str) -> Filter:
        if name not in self._engines:
            settings = self._configuration.filters[name]
            model = self._configuration.model(settings.sensors)
            made = filter_class(settings.kind)(model, self._configuration.prior, **settings.options)  # type: ignore[call-arg]
            self._engines[name] = made
        return self._engines[name]

    def _model(self, k: int) -> LSUModel | None:
        return None if self._configuration.has_one_model else self._configuration.stretch_model(k)

    def _held(self, boot: str, k: int) -> HeldInputs:
        """The inputs around a step, the box where one is not known."""
        if not self._configuration.base_model.input_count:
            return HeldInputs.constant()
        steps = range(k - 2, k + 2)
        box = self._configuration.input_box
        known = [self._inputs.get((boot, j)) for j in steps]
        values: Sequence[Drive] = [box if one is None else np.array(one.u) for one in known]
        return HeldInputs([self._configuration.grid.time_of(j) for j in steps], values, before=box)

    def _datum(self, k: int, message: Measurement) -> TimedDatum:
        """The message at its moment; of a discrete model at its step, with what that costs."""
        configuration, end = self._configuration, self._configuration.grid.time_of(k)
        sensor, outputs = configuration.sensors[message.name], configuration.outputs(message.name)
        y = np.array([np.nan if value is None else value for value in message.y])
        if message.time_error_ns is None:
            return TimedDatum(end, y, outputs=outputs, sensor=message.name)
        if configuration.continuous is not None:
            return TimedDatum(message.time_ns, y, message.time_error_ns, outputs=outputs, sensor=message.name)
        r = grid_half_widths(
            outputs, None, message.time_ns, error_ns=message.time_error_ns, step_ns=end,
            tolerance_ns=tolerance_ns(sensor), rate=sensor.rate or None, off_grid=sensor.off_grid,
        )  # fmt: skip
        return TimedDatum(end, y, outputs=outputs, r=r, sensor=message.name)

    def _update_at_once(self, engine: Filter, name: str, data: Sequence[TimedDatum]) -> None:
        """One datum of each sensor at t_k at most: one update takes all."""
        by_sensor = {one.sensor: one for one in data}
        y: list[Vector] = []
        r: list[Vector] = []
        for sensor in self._configuration.filters[name].sensors:
            outputs, one = self._configuration.outputs(sensor), by_sensor.get(sensor)
            y.append(np.full(outputs.output_count, np.nan) if one is None else one.y)
            r.append(np.array(outputs.r) if one is None or one.r is None else one.r)
        if data:
            engine.update(np.concatenate(y), np.concatenate(r))


def _is_copy(one: Measurement, other: Measurement) -> bool:
    """Whether two messages are one datum; of those without a time the first of a step counts."""
    if one.name != other.name or (one.time_error_ns is None) != (other.time_error_ns is None):
        return False
    moments = {(m.time_ns, m.time_error_ns, tuple(m.y)) for m in (one, other)}
    return one.time_error_ns is None or len(moments) == 1


def _is_simple(configuration: Configuration) -> bool:
    """Whether every input acts from its step on, and no output sees it."""
    return not configuration.input_delay_ns and not any(one.D for one in configuration.sensors.values())
