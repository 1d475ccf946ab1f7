"""``lsu-mesh identify``: bounds that explain the data of a configuration's files, or of a recording."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lsu_mesh.array_types import Matrix
from lsu_mesh.errors import LsuMeshError
from lsu_mesh.identification import Explanation, explain, report
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.problem import nearest
from lsu_mesh.mesh.data_files.spans import duration_text
from lsu_mesh.mesh.keys import parse
from lsu_mesh.mesh.measurement_time import goes_to_nearest
from lsu_mesh.mesh.messages import Input, Measurement, Message, Refused, decode
from lsu_mesh.mesh.nodes.played_rows import PlayedRows
from lsu_mesh.mesh.nodes.recorded_inputs import recorded_inputs
from lsu_mesh.rate_identification import explain_rates
from lsu_mesh_services.bank_limits import refuses_bank
from lsu_mesh_services.configuration import load_or_explain, print_warnings
from lsu_mesh_services.exit_codes import FAILURE, NOT_MET, OK, USAGE
from lsu_mesh_services.played_files import accounts_or_explain

Rows = Mapping[int, Iterable[float | None]]


class NoData(LsuMeshError):
    """There is nothing to explain; the text says what is missing."""


def main(options: argparse.Namespace) -> int:
    configuration = load_or_explain(options.file, options)
    if configuration is None or refuses_bank(configuration, "identify"):
        return USAGE
    print_warnings(configuration)
    unknown_sensors = [name for name in options.sensors or () if name not in configuration.sensors]
    if unknown_sensors:
        known = nearest(unknown_sensors[0], configuration.sensors)
        print(f"{options.file}: there is no sensor {unknown_sensors[0]!r}; {known}", file=sys.stderr)
        return USAGE
    if not options.recording and accounts_or_explain(configuration) is None:
        return USAGE
    try:
        names, Y, U, first = _data(configuration, options)
        found = _explained(configuration, names, Y, U=U, options=options)
    except (LsuMeshError, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return FAILURE if not isinstance(error, NoData) else USAGE
    is_rate = configuration.continuous is not None
    print(json.dumps(_record(found, first)) if options.json else _words(found, names, first, is_rate=is_rate))
    return OK if found.held_out is None or found.held_out.is_explained else NOT_MET


def _explained(
    configuration: Configuration, names: list[str], Y: Matrix, *, U: Matrix | None, options: argparse.Namespace
) -> Explanation:
    """The bounds of a step, or of a continuous model the rates."""
    model = configuration.model(names)
    if configuration.continuous is None:
        return explain(
            model, Y, U, learn=options.learn, margin=options.margin, share=options.share,
            unknown=[text.split(",") for text in options.unknown],
        )  # fmt: skip
    if options.unknown:
        raise NoData(f"{options.file}: --unknown needs a discrete model: entries of a step are no rates; leave it out")
    grid = configuration.grid
    if (grid.dt * 10**9).denominator != 1:
        raise NoData(f"{options.file}: rates are looked for in equal steps: choose a dt of whole nanoseconds")
    assert model.flow is not None
    return explain_rates(
        model.flow, Y, U, dt_ns=grid.time_of(2) - grid.time_of(1), learn=options.learn, margin=options.margin,
        share=options.share,
    )  # fmt: skip


def _data(
    configuration: Configuration, options: argparse.Namespace
) -> tuple[list[str], Matrix, Matrix | None, int]:  # fmt: skip
    """Names of the sensors, outputs (T, m), inputs (T − 1, p), and the step of the first row."""
    if configuration.schedule:
        raise NoData(f"{options.file}: one model is looked for, and [[model.schedule]] names several: remove it")
    if configuration.input_delay_ns:
        raise NoData(f"{options.file}: inputs have to act for whole steps: remove input_delay")
    if options.recording:
        measured, inputs = _recorded(configuration, options.recording)
    else:
        measured, inputs = _played(configuration), _played_inputs(configuration)
    names = [name for name in sorted(configuration.sensors) if name in measured]
    names = [name for name in names if options.sensors is None or name in options.sensors]
    if not names:
        raise NoData(f"{options.file}: no sensor has data: none plays a file; give a recording by --recording FILE.rrd")
    first = min(min(measured[name]) for name in names)
    last = max(max(measured[name]) for name in names)
    columns = []
    for name in names:
        block = np.full((last - first + 1, len(configuration.sensors[name].C)), np.nan)
        for step, values in measured[name].items():
            block[step - first] = [np.nan if value is None else value for value in values]
        columns.append(block)
    if not configuration.base_model.input_count:
        return names, np.hstack(columns), None, first
    missing = [step for step in range(first, last) if step not in inputs]
    if missing:
        raise NoData(f"{options.file}: the model has inputs, and the input of step {missing[0]} is not in the data")
    U = np.array([list(inputs[step]) for step in range(first, last)], dtype=np.float64)
    return names, np.hstack(columns), U, first


def _played(configuration: Configuration) -> dict[str, Rows]:
    """Values by step of each sensor that plays a file."""
    played: dict[str, dict[int, Iterable[float | None]]] = {}
    for name, sensor in configuration.sensors.items():
        if sensor.file is None:
            continue
        rows = PlayedRows(configuration, name)
        for k in range(rows.first, rows.last + 1):
            for row in rows.of(k):
                _add(played.setdefault(name, {}), configuration, name, k, time=(row.time_ns, row.error_ns), y=row.y)
    return dict(played)


def _played_inputs(configuration: Configuration) -> Rows:
    plant = configuration.plant
    return {} if plant is None or plant.file is None else recorded_inputs(configuration, plant.file)


def _add(
    by_step: dict[int, Iterable[float | None]], configuration: Configuration, name: str, k: int, *,
    time: tuple[int, int], y: Iterable[float | None],
) -> None:  # fmt: skip
    """One measurement of a step; raises :class:`NoData` where it is of another moment, or not the only one."""
    sensor, (time_ns, error_ns) = configuration.sensors[name], time
    off = abs(time_ns - configuration.grid.time_of(k)) + error_ns
    what = ""
    if off and not goes_to_nearest(configuration, sensor):
        what = f"lies up to {duration_text(off)} from step {k}"
    elif k in by_step:
        if np.array_equal(np.array([*by_step[k]], dtype=float), np.array([*y], dtype=float), equal_nan=True):
            return  # a copy
        what = f"is not the only one of step {k}"
    if what:
        raise NoData(
            f"{configuration.path}: a measurement of {name} {what}, and bounds are looked for by steps: choose a dt "
            'and a start_time that fit the data, or put them on the nearest step with off_grid = "nearest"'
        )
    by_step[k] = y


def _recorded(configuration: Configuration, path: str) -> tuple[dict[str, Rows], Rows]:
    """Measurements by sensor and step, and inputs by step; the first input of each counts."""
    from lsu_mesh_services.recording.read import read_raw

    measured: dict[str, dict[int, Iterable[float | None]]] = {}
    inputs: dict[int, list[float | None]] = {}
    for raw in read_raw(Path(path)):
        message = _decoded(raw.key, raw.payload)
        if isinstance(message, Measurement) and message.name in configuration.sensors:
            at = configuration.grid.time_of(message.step)
            time = (at, 0) if message.time_error_ns is None else (message.time_ns, message.time_error_ns)
            rows = measured.setdefault(message.name, {})
            _add(rows, configuration, message.name, message.step, time=time, y=message.y)
        elif isinstance(message, Input):
            inputs.setdefault(message.step, list(message.u))
    return dict(measured), inputs


def _decoded(key: str, payload: bytes) -> Message | None:
    address = parse(key)
    try:
        return None if address is None else decode(address.topic, payload)
    except Refused:
        return None


def _words(found: Explanation, names: list[str], first: int, *, is_rate: bool) -> str:
    notes = [f"rows are steps from {first}"] if first != 1 else []
    notes += ["rho is a rate: a bound of the noise at every moment"] if is_rate else []
    head = "; ".join([f"sensors {', '.join(names)}", *notes])
    return f"{head}\n{report(found)}"


def _record(found: Explanation, first: int) -> dict[str, Any]:
    held = found.held_out
    return {
        "first_step": first, "rows_used": [found.first, found.last], "learn": found.learn, "margin": found.margin,
        "factor": None if math.isnan(found.factor) else found.factor, "rho": found.rho.tolist(), "r": found.r.tolist(),
        "smallest_rho": found.smallest_rho.tolist(), "smallest_r": found.smallest_r.tolist(),
        "entries": [[*entry, value] for entry, value in zip(found.entries, found.theta.tolist(), strict=True)],
        "held_out": None if held is None else {
            "rows": [held.first, held.last], "factor": held.factor, "explained": held.is_explained,
            "broken": None if held.broken is None else [
                b._replace(gap=b.gap if math.isfinite(b.gap) else None)._asdict()  # type: ignore[arg-type]
                for b in held.broken
            ],
        },
    }  # fmt: skip
