"""How the models and the sensors of a simulated mesh go by time: on the grid, or at moments of their own."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lsu_mesh.mesh.config.settings import Configuration, ScheduledModel, SensorSettings
from lsu_mesh.mesh.nodes.plant_course import PlantCourse
from lsu_mesh.model import ContinuousModel, LSUModel
from lsu_mesh.supports.orthotope import Orthotope

ON_THE_GRID = 0.5
"""Share of the runs in which times are those of the configuration."""
TIMES = ("continuous", "own moments", "erring clocks", "late inputs", "rates", "schedule")
GRID_TIMES = ("", "rates", "schedule")
"""Those of discrete models, in which a step is one time update."""
RHYTHMS: Sequence[tuple[float, float]] = ((0.3, 0.1), (10.0 / 7.0, 0.0), (4.0, 16.0))
"""Period and jitter of sensors in steps: several per step, out of step, and irregular."""
CLOCK_ERROR, INPUT_DELAY = 0.05, 0.2
"""In steps."""
CHANGE = 20
"""The step from which another model is in force."""
INPUTS = 6.0
"""Half-width of an input box that is true."""
WINDOWED = "WindowMAP"
MARGIN = 1.01
"""The rate of an output is declared by so much larger than it is."""


def draw_times(rng: random.Random, base: Configuration) -> str:
    """One of :data:`TIMES`, or nothing."""
    goes_by_steps = any(one.kind == WINDOWED or one.adopt for one in base.filters.values()) or base.identifiers
    if goes_by_steps or base.mesh.is_live or rng.random() < ON_THE_GRID:
        return ""
    has_grid_only = base.has_one_model
    ways = [way for way in TIMES if has_grid_only or way not in ("rates", "schedule", "continuous")]
    return rng.choice([way for way in ways if way != "late inputs" or base.base_model.input_count])


def timed(configuration: Configuration, way: str) -> Configuration:
    """The mesh that goes by time in a way."""
    if way == "":
        return configuration
    if way == "schedule":
        model = configuration.base_model
        entry = ScheduledModel(CHANGE, model.replace(rho=2.0 * model.rho))
        return replace(configuration, schedule=(entry,))
    if way == "rates":
        return _with_rates(configuration)
    found = configuration if configuration.continuous is not None else with_flow(configuration, _flow_of(configuration))
    if way == "late inputs":
        p = configuration.base_model.input_count
        box = configuration.input_box or Orthotope([-INPUTS] * p, [INPUTS] * p)
        found = replace(found, input_box=box, input_delay_ns=_in_steps(configuration, INPUT_DELAY))
    if way == "continuous":
        return found
    return replace(found, sensors=_moving(configuration, errs=way == "erring clocks"))


def with_flow(configuration: Configuration, flow: ContinuousModel) -> Configuration:
    """The mesh with a continuous model; ``base_model`` is that of its first step."""
    step_ns = configuration.grid.time_of(2) - configuration.grid.time_of(1)
    return replace(configuration, continuous=flow, base_model=flow.discretised(step_ns))


def _flow_of(configuration: Configuration) -> ContinuousModel:
    """A continuous model that moves about as much in a step as the discrete one; it is another system."""
    model, per_second = configuration.base_model, 1.0 / configuration.mesh.dt
    further: dict[str, Any] = {} if model.a is None else {"a": per_second * model.a}
    return LSUModel.continuous(
        per_second * (model.A - np.eye(model.state_count)),
        None if model.B is None else per_second * model.B,
        model.C,
        rho=per_second * model.rho,
        r=model.r,
        noise_map=model.noise_map,
        domain=model.domain,
        states=model.states,
        inputs=model.inputs,
        units=model.units,
        **further,
    )


def _moving(configuration: Configuration, *, errs: bool) -> Mapping[str, SensorSettings]:
    """The sensors, each in a rhythm of its own."""
    error = _in_steps(configuration, CLOCK_ERROR) if errs else 0
    found = {}
    for i, (name, sensor) in enumerate(sorted(configuration.sensors.items())):
        every, jitter = RHYTHMS[i % len(RHYTHMS)]
        found[name] = replace(
            sensor, every_ns=_in_steps(configuration, every), jitter_ns=_in_steps(configuration, jitter),
            clock_error_ns=error, time_error_ns=error,
        )  # fmt: skip
    return found


def _with_rates(configuration: Configuration) -> Configuration:
    """Own moments beside a discrete model, with rates that are true of this very course."""
    course, x, largest = PlantCourse(configuration), PlantCourse(configuration).first, {}
    for name, sensor in configuration.sensors.items():
        largest[name] = np.zeros(len(sensor.C))
    for k in range(1, (configuration.mesh.steps or 0) + 1):
        following = course.next(k, x)
        for name, sensor in configuration.sensors.items():
            moved = np.abs(np.array(sensor.C) @ (following - x)) / configuration.mesh.dt
            largest[name] = np.maximum(largest[name], moved)
        x = following
    moving = _moving(configuration, errs=True)
    rates = {name: tuple((MARGIN * rate).tolist()) for name, rate in largest.items()}
    return replace(configuration, sensors={name: replace(moving[name], rate=rates[name]) for name in moving})


def _in_steps(configuration: Configuration, steps: float) -> int:
    return round(steps * float(configuration.grid.dt) * 1e9)
