"""An identifier: watches measurements and inputs, and suggests bounds that explain them.

Every ``every`` steps it finds the smallest factor of the bounds in force for which a trajectory of states fits the data
of the window. A factor of at most 1: the bounds explain the data. A larger factor: it publishes a suggestion, the
bounds times the factor and a margin, with the step at which filters may adopt them, and uses these itself from then
on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, LsuMeshError
from lsu_mesh.filters.window.batch_map import Record
from lsu_mesh.filters.window.structure import Structure
from lsu_mesh.identification import learn_choice, smallest
from lsu_mesh.mesh.access import PUBLISHES, subscriptions
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.measurement_time import is_of_its_step
from lsu_mesh.mesh.messages import Input, Measurement, Message, Suggestion
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.time_requirements import check_times
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

GIVEN_UP = 8
"""A step whose measurements have not all come when so many later ones have is looked at as it is."""
MAX_WAITING = 1024
"""Steps beyond the window that are kept while something is waited for."""
OFF_GRID = "off the grid"
"""Measurements between the steps are not looked at, and counted by this."""
ROUNDING = 1e-9
"""A factor above 1 by no more than this is one of the solver's rounding."""


class IdentifierNode(Node):
    """Tells whether the bounds in force explain the data of the last steps, and which would."""

    role = "identifier"
    publishes = PUBLISHES["identifier"]

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        super().__init__(configuration, name, boot)
        check_times(configuration, self.role, name)
        self.settings = configuration.identifiers[name]
        self._model = configuration.model(self.settings.sensors)
        """With the bounds in force."""
        self._declared = self._model
        self._y: dict[int, dict[str, Vector]] = {}
        self._u: dict[int, Vector] = {}
        self._newest = 0
        self._looked_at = 0
        self._explained = True
        self._counts: dict[str, float] = {"looks": 0, "suggestions": 0, "unsolved": 0, "factor": 0.0}

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return subscriptions(self.configuration, self.role, self.name)

    def receive(self, message: Message, now: int) -> list[Message]:
        if isinstance(message, Measurement):
            if message.step < 1 or not is_of_its_step(self.configuration, message):
                self._counts[OFF_GRID] = self._counts.get(OFF_GRID, 0) + 1
                return []
            values = np.array([np.nan if value is None else value for value in message.y])
            self._y.setdefault(message.step, {}).setdefault(message.name, values)
            self._newest = max(self._newest, message.step)
        elif isinstance(message, Input):
            self._u.setdefault(message.step, np.array(message.u))
        most = 2 * (self.settings.window + self.settings.every) + MAX_WAITING
        for kept in (self._y, self._u):
            while len(kept) > most:  # the other kind does not come
                del kept[next(iter(kept))]
        return []

    def advance(self, now: int) -> list[Message]:
        every = self.settings.every
        last = self._newest - self._newest % every
        if last <= self._looked_at or last < 2 or not self._is_whole(last):
            return []
        self._looked_at = last
        first = max(1, last - self.settings.window + 1)
        record = self._record(first, last)
        self._forget_before(last + every - self.settings.window)
        return [] if record is None else self._look(record, first, last, now)

    def _is_whole(self, k: int) -> bool:
        """Whether all measurements of step k have come, or will not."""
        return self._newest >= k + GIVEN_UP or all(name in self._y.get(k, {}) for name in self.settings.sensors)

    def _forget_before(self, k: int) -> None:
        self._y = {step: values for step, values in self._y.items() if step >= k}
        self._u = {step: u for step, u in self._u.items() if step >= k}

    def _record(self, first: int, last: int) -> Record | None:
        """Outputs and inputs of these steps; ``None`` where an input, or all data, are missing."""
        p = self._model.input_count
        inputs = [self._u.get(k) for k in range(first, last)] if p else [np.zeros(0)] * (last - first)
        known = [u for u in inputs if u is not None]
        if len(known) < last - first:
            return None
        Y = np.vstack([self._outputs(k) for k in range(first, last + 1)])
        return None if np.isnan(Y).all() else Record(Y, np.array(known).reshape(last - first, p))

    def _outputs(self, k: int) -> Vector:
        step, sensors = self._y.get(k, {}), self.configuration.sensors
        return np.concatenate([step.get(name, np.full(len(sensors[name].C), np.nan)) for name in self.settings.sensors])

    def _look(self, record: Record, first: int, last: int, now: int) -> list[Message]:
        self._counts["looks"] += 1
        learn = learn_choice(self.settings.learn)
        try:
            factor = smallest(Structure(self._model), record, learn, self._box(first)).objective
        except InconsistentData as error:
            text = f"steps {first} to {last}: no {learn} explains the data: {error}"
            return [
                self.event("ERROR", "nothing-explains", text, now=now, step=last, about={"first": first, "last": last})
            ]
        except LsuMeshError as error:
            self._counts["unsolved"] += 1
            return [
                self.event("WARN", "not-looked-at", f"steps {first} to {last}: {error}", now=now, step=last, about={})
            ]
        self._counts["factor"] = factor
        explained = factor <= 1.0 + ROUNDING
        suggestion = self._suggestion(factor, explained, first, last=last, now=now)
        told = self._reported(factor, explained, suggestion, now)
        if not explained:
            self._counts["suggestions"] += 1
            self._model = self._bounded(suggestion)
        self._explained = explained
        return [suggestion, *told]

    def _box(self, first: int) -> Orthotope | None:
        """The prior, if the window begins with the first step."""
        return self.configuration.prior if first == 1 else None

    def _suggestion(self, factor: float, explained: bool, first: int, last: int, now: int) -> Suggestion:
        settings, model = self.settings, self._model
        grown = factor * settings.margin
        rho = model.rho * (grown if settings.learn != "r" else 1.0)
        r = model.r * (grown if settings.learn != "rho" else 1.0)
        by_sensor, start = {}, 0
        for name in settings.sensors:
            size = len(self.configuration.sensors[name].C)
            by_sensor[name] = r[start : start + size].tolist()
            start += size
        return Suggestion(
            **self.stamp("bounds", last, now), rho=rho.tolist(), r=by_sensor, factor=factor, margin=settings.margin,
            first=first, last=last, explained=explained, adopt_at=None if explained else last + settings.lead,
        )  # fmt: skip

    def _bounded(self, suggestion: Suggestion) -> LSUModel:
        r = [width for name in self.settings.sensors for width in suggestion.r[name]]
        return self._model.replace(rho=suggestion.rho, r=r)

    def _reported(self, factor: float, explained: bool, suggestion: Suggestion, now: int) -> list[Message]:
        first, last = suggestion.first, suggestion.last
        about: dict[str, str | int | float | None] = {"first": first, "last": last, "factor": factor}
        if not explained:
            whose = "declared" if self._model is self._declared else "adopted"
            text = (
                f"the {whose} bounds no longer explain the data of steps {first} to {last}: they would have to be "
                f"{factor:.4g} times as large; suggested from step {suggestion.adopt_at} on: "
                f"{self.settings.margin:g} times that"
            )
            about["adopt_at"] = suggestion.adopt_at
            return [self.event("WARN", "bounds-do-not-explain", text, now=now, step=last, about=about)]
        if not self._explained:
            text = f"the bounds explain the data of steps {first} to {last}: {factor:.4g} times these bounds suffice"
            return [self.event("INFO", "bounds-explain", text, now=now, step=last, about=about)]
        return []

    def step(self) -> int:
        return self._looked_at

    def counters(self) -> dict[str, float]:
        return self._counts

    def warm_up(self) -> None:
        Y = np.zeros((3, self._model.output_count))
        data = Record(Y, np.zeros((2, self._model.input_count)))
        smallest(Structure(self._model), data, learn_choice(self.settings.learn))
