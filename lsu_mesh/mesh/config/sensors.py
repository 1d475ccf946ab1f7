"""``[plant]`` and ``[sensors.NAME]``: what is simulated, and what is played from files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import get_args

from lsu_mesh.mesh.bank_messages import MAX_INSTANCES
from lsu_mesh.mesh.config.data_file_keys import KEYS, read_file_format
from lsu_mesh.mesh.config.expected import each, shown, whole
from lsu_mesh.mesh.config.measurement_files import FileProblems, read_columns
from lsu_mesh.mesh.config.problem import Problems, data_problem
from lsu_mesh.mesh.config.ros2 import read_topic
from lsu_mesh.mesh.config.sensor_parts import read_further_outputs, read_timing
from lsu_mesh.mesh.config.settings import (
    FaultKind,
    MeasurementFileSettings,
    PlantSettings,
    SensorFault,
    SensorSettings,
    Source,
)
from lsu_mesh.mesh.config.system import System
from lsu_mesh.mesh.config.table import REQUIRED, Table, file_at
from lsu_mesh.mesh.keys import NAME_RULE, is_name
from lsu_mesh.model import LSUModel

INPUTS = ("normal", "sine", "zero")
SOURCES: tuple[Source, ...] = get_args(Source)
FAULTS: tuple[FaultKind, ...] = get_args(FaultKind)
INSTANCES = each("a list of instances of a bank, counted from 0", whole(0, MAX_INSTANCES - 1))


def read_plant(
    table: Table | None,
    model: LSUModel | None,
    sensors: Mapping[str, SensorSettings],
    folder: Path,
    problems: Problems,
) -> PlantSettings | None:
    """``[plant]``; needed as soon as one sensor is simulated."""
    simulated = [sensor.name for sensor in sensors.values() if sensor.is_simulated]
    if table is None:
        if not simulated:
            return None
        table = Table({}, "plant", problems)
    name = table.text("name", "plant")
    if not is_name(name):
        table.wrong("name", f"{shown(name)} is no name; expected {NAME_RULE}", NAME_RULE)
    is_external = table.choice("source", ("simulated", "file", "external"), "simulated") == "external"
    if is_external:
        for key in ("x1", "inputs", "file"):
            if key in table.values:
                table.without(key, "has no effect: a program sends the inputs", "remove it")
    x1 = table.vector("x1", None)
    if x1 is not None and model is not None and len(x1) != model.state_count:
        table.mismatch("x1", f"{model.state_count} numbers, one per state", len(x1))
    count = 0 if model is None else model.input_count
    file = _read_file(table, count, folder, "input")
    inputs = table.choice("inputs", INPUTS, "normal")
    if file is not None and "inputs" in table.values:
        table.without("inputs", "has no effect beside a file of inputs", "remove one of the two")
    inputs = "file" if file is not None else inputs
    table.finish()
    return PlantSettings(name, None if x1 is None else tuple(x1), inputs, file, is_external=is_external)


def read_sensor(table: Table, name: str, system: System, folder: Path) -> SensorSettings:
    """``[sensors.NAME]``."""
    rows = table.matrix("C")
    is_read = isinstance(rows, list)
    rows, states = rows if is_read else [[0.0]], system.state_count
    if states is not None and is_read and len(rows[0]) != states:
        table.mismatch("C", f"{states} columns, one per state", len(rows[0]))
    widths = table.vector("r")
    widths = widths if isinstance(widths, list) else [0.0] * len(rows)
    if is_read and len(widths) != len(rows):
        table.mismatch("r", f"{len(rows)} half-widths, one per row of C", len(widths))
    if any(width < 0 for width in widths):
        table.wrong("r", f"half-widths must not be negative, found {shown(widths)}", "half-widths ≥ 0")
    default = [name] if len(rows) == 1 else [f"{name}.{i + 1}" for i in range(len(rows))]
    outputs = table.texts("outputs", default)
    if is_read and len(outputs) != len(rows):
        table.mismatch("outputs", f"{len(rows)} names, one per row of C", len(outputs))
    usual: Source = "file" if "file" in table.values else "simulated"
    source = table.choice("source", SOURCES, usual)
    file = _read_file(table, len(rows), folder, "row of C")
    if source != "file" and file is not None:
        table.wrong("source", f'is "{source}", but a file is given; remove one of the two', '"file", or no file')
    if source == "file" and file is None and "file" not in table.values:
        table.wrong("file", 'is missing; source = "file" needs the path of a CSV file', "the path of a CSV file")
    simulated = tuple(table.vector("simulated_r", []))
    if simulated and (source != "simulated" or len(simulated) != len(rows) or min(simulated) < 0):
        table.mismatch("simulated_r", f'{len(rows)} half-widths ≥ 0, and source = "simulated"', shown(simulated))
    faults = tuple(_read_fault(item) for item in table.tables("faults"))
    if faults and source != "simulated":
        table.without("faults", "faults are simulated, and this sensor is not", "remove the key")
    further = read_further_outputs(table, len(rows) if is_read else None, system.model)
    timing = read_timing(table, len(rows) if is_read else None, system, is_simulated=source == "simulated")
    topic = read_topic(table, len(rows) if is_read else None, is_used=source == "ros2")
    table.finish()
    return SensorSettings(
        name=name,
        C=tuple(map(tuple, rows)),
        r=tuple(widths),
        outputs=tuple(outputs),
        file=file,
        faults=faults,
        simulated_r=simulated,
        live=source if source == "external" or source == "ros2" else "",
        ros2=topic,
        **further,
        **timing,
    )


def _read_fault(table: Table) -> SensorFault:
    kind = table.choice("kind", FAULTS, REQUIRED)
    first, last = table.whole("from", 1, low=1), table.whole("to", 2**53, low=1)
    if first > last:
        table.wrong("to", f"is {last}, before from = {first}", f"a whole number ≥ {first}")
    size = table.number("size", 1.0)
    named: list[int] = table.read("instances", [], INSTANCES)
    table.finish()
    return SensorFault("bias" if kind is REQUIRED else kind, first, last, size, instances=tuple(named))


def _read_file(table: Table, count: int, folder: Path, per: str) -> MeasurementFileSettings | None:
    """The keys ``file``, ``columns`` and ``time`` or ``step``; the file itself is read and checked too."""
    text = table.text("file", None)
    columns = table.texts("columns", None)
    by_time, by_step = table.text("time", None), table.text("step", None)
    file_format = read_file_format(table)
    if text is None:
        for key in ("columns", "time", "step", *KEYS):
            if key in table.values:
                table.without(key, "has no effect without file = the path of a CSV file", "remove it or give the file")
        return None
    if by_time is not None and by_step is not None:
        text = "give either time or step, the name of the column that orders the rows, not both"
        table.wrong("step", text, "either time or step")
    index, indexed_by = (by_time, "time") if by_time is not None else (by_step or "step", "step")
    if columns is not None and len(columns) != count:
        table.mismatch("columns", f"{count} column names, one per {per}", len(columns))
        columns = None
    if "\0" in text:
        table.mismatch("file", "the path of a CSV file", shown(text))
        return None
    path = file_at(text, folder)
    settings = MeasurementFileSettings(path, tuple(columns or ()), index, indexed_by, **file_format)
    if not table.problems.reads_files:
        return settings
    try:
        header = read_columns(settings, default_count=count).columns
    except FileProblems as error:
        table.problems.records += [data_problem(table.path, path, line) for line in error.lines]
        return settings
    return replace(settings, columns=header)
