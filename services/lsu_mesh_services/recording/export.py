"""Tables of a recording for other programs, and its measurements as files that sensors play.

A folder gets ``estimates`` (every posterior and fused set: bounds, point, errors), ``truth`` and ``inputs`` where they
were recorded, one CSV file per sensor, and ``mesh.toml``, which runs the mesh on these files.
"""

from __future__ import annotations

import copy
import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.config.write import to_toml
from lsu_mesh.mesh.messages import Input, Measurement, Posterior, Truth
from lsu_mesh_services.recording.entity_paths import outputs_of, told_apart
from lsu_mesh_services.recording.read import Received, Recording

Row = dict[str, Any]
MEASUREMENTS = "measurements"
INPUTS = "inputs.csv"


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
    """``estimates`` and ``truth`` as rows."""
    configuration = recording.configuration
    states = told_apart(configuration.base_model.states)
    truth = {m.step: m.x for m in (one.message for one in recording.received) if isinstance(m, Truth)}
    posteriors = [one for one in recording.received if isinstance(one.message, Posterior)]
    newest = {(one.message.src, one.message.step): one.message.reference for one in posteriors}
    estimates = [_estimate(one, configuration, states, truth=truth, newest=newest) for one in posteriors]
    listed = [{"step": k, "time": k * configuration.mesh.dt, **dict(zip(states, truth[k], strict=True))} for k in truth]
    return {"estimates": estimates, "truth": listed}


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


def write_playable(recording: Recording, folder: Path, replayed: Configuration | None = None) -> list[Path]:
    """Measurements and inputs as CSV files, and a configuration that plays them; the first of a step counts.

    ``replayed`` is the configuration whose filters and fusions are to run; default: the recorded one.
    """
    configuration = replayed or recording.configuration
    values = copy.deepcopy(dict(configuration.values))
    values.pop("network", None)  # where the recorded mesh was is no place for another one
    measured: dict[str, dict[int, Measurement]] = {}
    inputs: dict[int, Input] = {}
    for message in (one.message for one in recording.received):
        if isinstance(message, Measurement):
            measured.setdefault(message.name, {}).setdefault(message.step, message)
        elif isinstance(message, Input):
            inputs.setdefault(message.step, message)
    files = []
    for name, by_step in sorted(measured.items()):
        if name not in configuration.sensors:
            continue
        parts = tuple(output.part for output in outputs_of(configuration.sensors[name]))
        labels = [f"output {part}" if part in ("step", "time") else part for part in parts]
        ordered = sorted(by_step.items())
        rows = [{"step": k, "time": m.time_ns * 1e-9, **dict(zip(labels, m.y, strict=True))} for k, m in ordered]
        files.append(_write_csv(rows, folder / MEASUREMENTS / f"{name}.csv"))
        kept = {key: value for key, value in values["sensors"][name].items() if key in ("C", "r", "outputs")}
        played = {"file": f"{MEASUREMENTS}/{name}.csv", "step": "step", "columns": labels}
        values["sensors"][name] = kept | played
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
