"""Whether a measurement that came late is in the set of its step: the set is computed again without the node.

Only for filters whose message holds all that they know (orthotopes and parallelotopes) and that take no transfers, in a
mesh of one model whose data are of the grid.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Input, Measurement, Message, Posterior
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.sets import to_message, to_support
from lsu_mesh.mesh.simulator.broken import InvariantBroken

KINDS = ("LSUO", "LSUP")


class Recomputation:
    """Remembers, per life of a filter, its measurements and inputs, and which steps got something late."""

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._engines: dict[str, Filter] = {}
        self._inputs: dict[tuple[str, int], Input] = {}
        self._measured: dict[tuple[str, int], dict[str, Measurement]] = {}
        self._late: dict[str, set[int]] = {}
        self._watched = {
            name
            for name, settings in configuration.filters.items()
            if settings.kind in KINDS and settings.transfer == "off" and _is_plain(configuration)
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
            self._measured.setdefault((node.boot, message.step), {}).setdefault(message.name, message)
            if current is not None and message.step <= current:
                self._late.setdefault(node.boot, set()).add(message.step)

    def check(self, node: Node, newest: dict[int, Posterior]) -> None:
        """The newest set of each step that got something late is what its data make of the set before."""
        for k in sorted(self._late.pop(node.boot, ())):
            before, found = newest.get(k - 1), newest.get(k)
            drive = self._inputs.get((node.boot, k - 1))
            if before is None or found is None or {before.boot, found.boot} != {node.boot}:
                continue
            if found.status == "restarted":
                continue
            expected = self._computed(node, k, before, drive)
            if to_message(expected.support) != found.support:
                text = f"{found.src} step {k} revision {found.revision}: its data make another set of step {k - 1}"
                raise InvariantBroken("late data", text)

    def _computed(self, node: Node, k: int, before: Posterior, drive: Input | None) -> Filter:
        settings = self._configuration.filters[node.name]
        engine = self._engines.get(node.name)
        if engine is None:
            model = self._configuration.model(settings.sensors)
            made = filter_class(settings.kind)(model, self._configuration.prior, **settings.options)  # type: ignore[call-arg]
            engine = self._engines[node.name] = made
        engine.reset(to_support(before.support))
        engine.predict(np.array(drive.u) if drive is not None else self._configuration.input_box)
        measured = self._measured.get((node.boot, k), {})
        y: list[float] = []
        for sensor in settings.sensors:
            rows = len(self._configuration.sensors[sensor].C)
            values = measured[sensor].y if sensor in measured else [None] * rows
            y += [np.nan if value is None else value for value in values]
        if not np.isnan(y).all():
            engine.update(y)
        return engine


def _is_plain(configuration: Configuration) -> bool:
    """Whether a step is one time update by one model and one data update."""
    sensors = configuration.sensors.values()
    return configuration.has_one_model and not any(
        one.D or one.offset or one.period or one.every_ns or one.jitter_ns or one.time_error_ns for one in sensors
    )
