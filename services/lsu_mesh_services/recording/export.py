"""Tables of a recording for other programs, and its measurements as files that sensors play.

A folder gets ``estimates`` (every posterior and fused set: bounds, point, errors), and where they were recorded
``smoothed``, ``truth`` and ``inputs``; one CSV file per sensor, and ``mesh.toml``, which runs the mesh on these files.
"""

from __future__ import annotations

import copy
import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.write import to_toml
from lsu_mesh.mesh.data_files.spans import seconds_text
from lsu_mesh.mesh.messages import Input, Measurement, Posterior, Smoothed, Truth
from lsu_mesh_services.recording.entity_paths import outputs_of, told_apart
from lsu_mesh_services.recording.read import Received, Recording

Row = dict[str, Any]
MEASUREMENTS = "measurements"
INPUTS = "inputs.csv"
RESERVED = ("step", "time", "time_ns")
"""Columns of a sensor's file besides its outputs."""
KEPT = ("C", "r", "outputs", "D", "offset", "period", "time_error", "rate", "off_grid", "grid_tolerance")
"""Keys of a sensor that hold for its recorded data, too."""


def export(recording: Recording, folder: Path, form: str) -> list[Path]:
    """Write everything into a new or empty folder; returns the files.

    ``form`` is ``"csv"`` or ``"parquet"``; what sensors play and the inputs are CSV in any case. Raises ``OSError``
    where a file cannot be written or the folder holds something already.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        raise FileExistsError(17, "the folder is not empty", str(folder))
    files = [_write(rows, folder / f"{name}.{form}") for name, rows in tables(recording).items() if rows]
    return [*files, *write_playable(recording, folder)]


def tables(recording: Recording) -> dict[str, list[Row]]:
    """``estimates``, ``smoothed`` and ``truth`` as rows."""
    configuration = recording.configuration
    states = told_apart(configuration.base_model.states)
    truth = {m.step: m.x for m in (one.message for one in recording.received) if isinstance(m, Truth)}
    posteriors = [one for one in recording.received if isinstance(one.message, Posterior)]
    newest = {(one.message.src, one.message.step): one.message.reference for one in posteriors}
    estimates = [_estimate(one, configuration, states, truth=truth, newest=newest) for one in posteriors]
    smoothed = [one for one in recording.received if isinstance(one.message, Smoothed)]
    latest = {(one.message.src, one.message.step): one.message.reference for one in smoothed}
    sets = [_smoothed(one, configuration, states, truth=truth, newest=latest) for one in smoothed]
    listed = [{"step": k, "time": k * configuration.mesh.dt, **dict(zip(states, truth[k], strict=True))} for k in truth]
    return {"estimates": estimates, "smoothed": sets, "truth": listed}


def _estimate(
    one: Received, configuration: Configuration, states: Sequence[str], truth: dict[int, list[float]], newest: Any
) -> Row:
    message = one.message
    assert isinstance(message, Posterior)
    row: Row = {
        "peer": message.name,
        "kind": message.kind,
        "step": message.step,
        "time": message.step * configuration.mesh.dt,
        "time_ns": configuration.grid.time_of(message.step),
        "arrival_ns": one.arrival_ns,
        "latency_ms": (one.arrival_ns - message.origin_ns) * 1e-6,
        "revision": message.revision,
        "is_newest": newest[message.src, message.step] == message.reference,
        "status": message.status,
        "epoch": message.epoch,
        "guarantee": message.guarantee,
        "log_volume": message.log_volume,
    }
    x = truth.get(message.step)
    for i, state in enumerate(states):
        row |= {
            f"{state}.lower": message.lower[i],
            f"{state}.point": message.point[i],
            f"{state}.upper": message.upper[i],
            f"{state}.truth": None if x is None else x[i],
            f"{state}.error": None if x is None else message.point[i] - x[i],
        }
    return row


def _smoothed(
    one: Received, configuration: Configuration, states: Sequence[str], truth: dict[int, list[float]], newest: Any
) -> Row:
    """Of the state ``step``, given all data up to step ``step + lag``."""
    message = one.message
    assert isinstance(message, Smoothed)
    row: Row = {
        "peer": message.name,
        "step": message.step,
        "time": message.step * configuration.mesh.dt,
        "time_ns": configuration.grid.time_of(message.step),
        "lag": message.lag,
        "arrival_ns": one.arrival_ns,
        "revision": message.revision,
        "is_newest": newest[message.src, message.step] == message.reference,
        "epoch": message.epoch,
        "guarantee": message.guarantee,
    }
    x = truth.get(message.step)
    for i, state in enumerate(states):
        row |= {
            f"{state}.lower": message.lower[i],
            f"{state}.upper": message.upper[i],
            f"{state}.truth": None if x is None else x[i],
        }
    return row


def write_playable(recording: Recording, folder: Path, replayed: Configuration | None = None) -> list[Path]:
    """Measurements and inputs as CSV files, and a configuration that plays them; the first input of a step counts.

    A sensor that was measured off the grid, or several times a step, is played by its times in nanoseconds, any other
    by steps. Where messages declare larger errors of their times than the sensor, all are played with the largest.
    ``replayed`` is the configuration whose filters and fusions are to run; default: the recorded one.
    """
    configuration = replayed or recording.configuration
    values = copy.deepcopy(dict(configuration.values))
    values.pop("network", None)  # where the recorded mesh was is no place for another one
    measured: dict[str, list[Measurement]] = {}
    inputs: dict[int, Input] = {}
    for message in (one.message for one in recording.received):
        if isinstance(message, Measurement):
            measured.setdefault(message.name, []).append(message)
        elif isinstance(message, Input):
            inputs.setdefault(message.step, message)
    files = []
    for name, messages in sorted(measured.items()):
        if name not in configuration.sensors:
            continue
        table, path = values["sensors"][name], folder / MEASUREMENTS / f"{name}.csv"
        rows, keys = playable_rows(configuration, name, messages)
        files.append(_write_csv(rows, path))
        kept = {key: value for key, value in table.items() if key in KEPT}
        values["sensors"][name] = kept | {"file": f"{MEASUREMENTS}/{name}.csv"} | keys
    if inputs:
        parts = told_apart(configuration.base_model.inputs)
        labels = [f"input {part}" if part == "step" else part for part in parts]
        rows = [{"step": k, **dict(zip(labels, inputs[k].u, strict=True))} for k in sorted(inputs)]
        files.append(_write_csv(rows, folder / INPUTS))
        plant = {key: value for key, value in values.get("plant", {}).items() if key in ("name", "x1")}
        values["plant"] = plant | {"file": INPUTS, "step": "step", "columns": labels}
    text = folder / "mesh.toml"
    text.write_text(to_toml(values), encoding="utf-8")
    return [*files, text]


def playable_rows(
    configuration: Configuration, name: str, messages: Sequence[Measurement]
) -> tuple[list[Row], dict[str, Any]]:
    """The rows of a sensor's file, and the keys of its table that play them."""
    grid, sensor = configuration.grid, configuration.sensors[name]
    labels = [f"output {output.part}" if output.part in RESERVED else output.part for output in outputs_of(sensor)]
    timed = [(grid.time_of(one.step) if one.time_error_ns is None else one.time_ns, one) for one in messages]
    timed.sort(key=lambda entry: entry[0])
    is_by_step = all(time == grid.time_of(one.step) for time, one in timed)
    is_by_step &= len({one.step for one in messages}) == len(messages)
    rows = [
        {"step": one.step, "time": seconds_text(time), "time_ns": time, **dict(zip(labels, one.y, strict=True))}
        for time, one in timed
    ]
    keys: dict[str, Any] = {"step": "step"} if is_by_step else {"time": "time_ns", "time_unit": "ns"}
    error = max(one.time_error_ns or 0 for one in messages)
    if error > sensor.time_error_ns:
        keys["time_error"] = f"{error}ns"
    return rows, keys | {"columns": labels}


def _write(rows: Sequence[Row], path: Path) -> Path:
    if path.suffix == ".csv":
        return _write_csv(rows, path)
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.Table.from_pylist(list(rows)), path)
    return path


def _write_csv(rows: Sequence[Row], path: Path) -> Path:
    """Numbers are written so that reading gives the same bits; an empty cell is a missing value."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(_cells(rows))
    return path


def _cells(rows: Iterable[Row]) -> Iterable[Row]:
    for row in rows:
        yield {key: "" if value is None else value for key, value in row.items()}
