"""At which moment, and so at which step, a measurement was made. Admission and the verification both go by this."""

from __future__ import annotations

from typing import TypeVar

from msgspec import structs

from lsu_mesh.mesh.bank_messages import BankMeasurement
from lsu_mesh.mesh.config.settings import Configuration, SensorSettings
from lsu_mesh.mesh.messages import Measurement, Refused

Datum = TypeVar("Datum", bound=Measurement | BankMeasurement)

LEAST_TOLERANCE_NS = 1
"""A moment that was rounded to a nanosecond is on the grid."""


def is_timed(message: Measurement | BankMeasurement) -> bool:
    """Whether it was made at ``time_ns``; else at the time of its step, and ``time_ns`` is not read."""
    return message.time_error_ns is not None


def placed(configuration: Configuration, message: Datum) -> Datum:
    """The measurement with its step k, ``t_{k−1} < t ≤ t_k``; 0 where it is of t_0 or before.

    Discrete models know nothing between steps: a datum within the sensor's tolerance of a step is of that step, and
    one with ``off_grid = "nearest"`` of the nearest.

    Raises
    ------
    Refused
        ``time``: it names another step than that of its time. ``off the grid``: a discrete model cannot carry it to a
        step, and its sensor declares no ``rate``.
    """
    if message.time_error_ns is None:
        return message
    sensor = configuration.sensors[message.name]
    k = step_of(configuration, sensor, message.time_ns)
    if message.step not in (0, k):
        text = f"step {message.step} does not fit the time {message.time_ns} ns, which is of step {k}"
        raise Refused("time", text)
    if not may_be_used(configuration, sensor, message.time_ns, error_ns=message.time_error_ns):
        text = (
            f"{message.name} at {message.time_ns} ns ± {message.time_error_ns} ns cannot be carried to a step by a "
            "discrete model; give a continuous model, or the sensor a rate or off_grid"
        )
        raise Refused("off the grid", text)
    last = configuration.mesh.steps
    if last is not None and k > last:
        text, seconds = f"step {k} of a mesh that ends at step {last}", (last - k) / configuration.mesh.rate
        raise Refused("step", text, source=message.name, seconds=seconds)
    return message if message.step == k else structs.replace(message, step=max(0, k))


def goes_to_nearest(configuration: Configuration, sensor: SensorSettings) -> bool:
    """Whether data of the sensor are of the step that is nearest, whatever their time: no set is guaranteed then."""
    return configuration.continuous is None and sensor.off_grid == "nearest" and not sensor.rate


def step_of(configuration: Configuration, sensor: SensorSettings, time_ns: int) -> int:
    """The step of a moment, below 1 where it is of t_0 or before."""
    grid = configuration.grid
    if configuration.continuous is None:
        nearest = grid.nearest_step(time_ns)
        if goes_to_nearest(configuration, sensor) or abs(grid.time_of(nearest) - time_ns) <= tolerance_ns(sensor):
            return nearest
    return grid.step_of(time_ns)


def may_be_used(configuration: Configuration, sensor: SensorSettings, time_ns: int, error_ns: int) -> bool:
    """Whether the model, or a declaration of the sensor, tells what such a datum says of its step."""
    if configuration.continuous is not None or sensor.rate or sensor.off_grid == "nearest":
        return True
    return error_ns == 0 and configuration.grid.is_on_grid(time_ns, tolerance_ns(sensor))


def is_of_its_step(configuration: Configuration, message: Measurement) -> bool:
    """Whether it was made at t_k, or is taken as that within the sensor's tolerance: for peers that know steps only."""
    if message.time_error_ns is None:
        return True
    tolerance = tolerance_ns(configuration.sensors[message.name]) if configuration.continuous is None else 0
    return message.time_error_ns == 0 and abs(configuration.grid.time_of(message.step) - message.time_ns) <= tolerance


def tolerance_ns(sensor: SensorSettings) -> int:
    """So far from t_k a datum of a discrete model is of step k by declaration."""
    return LEAST_TOLERANCE_NS if sensor.tolerance_ns is None else sensor.tolerance_ns
