"""The body of ``POST /measurements/NAME``: ``{"y": [...], "time": "now", "time_error": "2ms"}``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from lsu_mesh.errors import LsuMeshError
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.expected import Unfit, shown, span_ns
from lsu_mesh.mesh.config.problem import nearest
from lsu_mesh.mesh.config.settings import SensorSettings
from lsu_mesh.mesh.data_files.iso_times import IsoTimes
from lsu_mesh_services.gateway.refusal import Refusal

KEYS = ("y", "time", "time_error")
MAX_BODY = 1 << 16
"""Bytes."""
MAX_NS = 2**63 - 1
EXAMPLE = 'send {"y": [1.5], "time": "now"}'
TIME_REMEDY = (
    'write a moment such as "2026-05-01T12:00:00.25Z", nanoseconds since 1970 as a string of digits, or "now"; '
    "a JSON number would lose digits in JavaScript"
)


@dataclass(frozen=True)
class Reading:
    """What a sensor measured, and when."""

    y: list[float | None]
    time_ns: int
    time_error_ns: int


def sensor_of(configuration: Configuration, name: str) -> SensorSettings:
    """The sensor of this name, whose measurements come from a program.

    Raises
    ------
    Refusal
        404 where there is none, 409 where the mesh makes its measurements itself.
    """
    sensor = configuration.sensors.get(name)
    if sensor is None:
        remedy = nearest(name, list(configuration.sensors))
        raise Refusal(404, f"the mesh has no sensor {name!r}", remedy, key="NAME", value=name)
    if sensor.live != "external":
        text = f'sensor {name!r} is not external: its measurements are of source = "{sensor.source}"'
        remedy = f'give [sensors.{name}] source = "external" in the configuration of the whole mesh'
        raise Refusal(409, text, remedy, key=f"sensors.{name}.source", value=sensor.source)
    return sensor


def read_reading(sensor: SensorSettings, body: bytes, now: int) -> Reading:
    """The reading in a body that came ``now``.

    Raises
    ------
    Refusal
        400 where the body is no JSON, 422 where a key does not hold what it should.
    """
    try:
        values = msgspec.json.decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise Refusal(400, f"the body is not JSON: {error}", EXAMPLE) from None
    if not isinstance(values, dict):
        raise Refusal(400, "the body is JSON, but no object", EXAMPLE)
    for key in values:
        if key not in KEYS:
            raise Refusal(422, f"unknown key {key!r}", nearest(key, KEYS), key=key, value=values[key])
    return Reading(_y(sensor, values), _time(values.get("time", "now"), now), _time_error(sensor, values))


def _y(sensor: SensorSettings, values: dict[str, Any]) -> list[float | None]:
    count = len(sensor.C)
    listed = ", ".join(sensor.outputs)
    remedy = f'send "y" as a list of {count} number{"s" if count > 1 else ""} ({listed}), null where missing'
    if "y" not in values:
        raise Refusal(422, 'the key "y" is missing', remedy, key="y", value="")
    y = values["y"]
    if not isinstance(y, list) or len(y) != count:
        found = f"{len(y)} entries" if isinstance(y, list) else shown(y)
        raise Refusal(422, f'"y" is {found}, expected a list of {count}', remedy, key="y", value=y)
    for i, value in enumerate(y):
        if value is not None and not _is_finite(value):
            text = f'"y" holds {shown(value)}, expected a finite number or null'
            raise Refusal(422, text, remedy, key=f"y[{i}]", value=value)
    return [None if value is None else float(value) for value in y]


def _is_finite(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _time(value: object, now: int) -> int:
    if value == "now":
        return now
    if not isinstance(value, str):
        raise Refusal(422, f'"time" is {shown(value)}, expected a string', TIME_REMEDY, key="time", value=value)
    if value.isascii() and value.isdigit():
        time_ns = int(value) if len(value) <= 19 else MAX_NS + 1
    else:
        time_ns = _iso_ns(value)
    if not 0 <= time_ns <= MAX_NS:
        raise Refusal(422, '"time" is no moment from 1970 to 2262', TIME_REMEDY, key="time", value=value)
    return time_ns


def _iso_ns(text: str) -> int:
    found = IsoTimes(np.array([text.strip().encode()], dtype=np.bytes_))
    if not found.is_time[0]:
        raise Refusal(422, f'"time" is {shown(text)}, which is no moment', TIME_REMEDY, key="time", value=text)
    return int(found.ns[0])


def _time_error(sensor: SensorSettings, values: dict[str, Any]) -> int:
    if "time_error" not in values:
        return sensor.time_error_ns
    value, expected = values["time_error"], span_ns()
    try:
        return expected.convert(value)
    except (Unfit, LsuMeshError):
        text = f'"time_error" is {shown(value)}, expected {expected.words}'
        raise Refusal(422, text, 'send it such as "2ms"', key="time_error", value=value) from None
