"""The tables of peers: plant, sensors, filters, fusion."""

from __future__ import annotations

import inspect
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import get_args

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.registry import FILTERS, filter_class
from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.config.measurement_files import FileProblems, read_columns
from lsu_mesh.mesh.config.settings import (
    FaultKind,
    FilterSettings,
    FusionSettings,
    IdentifierSettings,
    Learn,
    MeasurementFileSettings,
    OnContradiction,
    PlantSettings,
    SensorFault,
    SensorSettings,
    TransferWay,
)
from lsu_mesh.mesh.config.table import REQUIRED, Problems, Table, file_at, nearest
from lsu_mesh.mesh.keys import NAME_RULE, is_name
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

INPUTS = ("normal", "sine", "zero")
FAULTS: tuple[FaultKind, ...] = get_args(FaultKind)
TRANSFERS: tuple[TransferWay, ...] = get_args(TransferWay)
CONTRADICTIONS: tuple[OnContradiction, ...] = get_args(OnContradiction)
LEARNS: tuple[Learn, ...] = get_args(Learn)


def read_plant(
    table: Table | None,
    model: LSUModel | None,
    sensors: Mapping[str, SensorSettings],
    folder: Path,
    problems: Problems,
) -> PlantSettings | None:
    """``[plant]``; needed as soon as one sensor is simulated."""
    simulated = [sensor.name for sensor in sensors.values() if sensor.file is None]
    if table is None:
        if not simulated:
            return None
        table = Table({}, "plant", problems)
    name = table.text("name", "plant")
    if not is_name(name):
        table.wrong("name", f'"{name}" is no name; expected {NAME_RULE}')
    x1 = table.vector("x1", None)
    if x1 is not None and model is not None and len(x1) != model.state_count:
        table.wrong("x1", f"expected {model.state_count} numbers, one per state, found {len(x1)}")
    count = 0 if model is None else model.input_count
    file = _read_file(table, count, folder, "input")
    inputs = "file" if file is not None else table.choice("inputs", INPUTS, "normal")
    table.finish()
    return PlantSettings(name, None if x1 is None else tuple(x1), inputs, file)


def read_sensor(table: Table, name: str, states: int | None, folder: Path) -> SensorSettings:
    """``[sensors.NAME]``."""
    rows = table.matrix("C")
    rows = rows if isinstance(rows, list) else [[0.0]]
    if states is not None and table.values.get("C") and len(rows[0]) != states:
        table.wrong("C", f"expected {states} columns, one per state, found {len(rows[0])}")
    widths = table.vector("r")
    widths = widths if isinstance(widths, list) else [0.0] * len(rows)
    if len(widths) != len(rows):
        table.wrong("r", f"expected {len(rows)} half-widths, one per row of C, found {len(widths)}")
    if any(width < 0 for width in widths):
        table.wrong("r", f"half-widths must not be negative, found {widths}")
    default = [name] if len(rows) == 1 else [f"{name}.{i + 1}" for i in range(len(rows))]
    outputs = table.texts("outputs", default)
    if len(outputs) != len(rows):
        table.wrong("outputs", f"expected {len(rows)} names, one per row of C, found {len(outputs)}")
    source = table.choice("source", ("simulated", "file"), "file" if "file" in table.values else "simulated")
    file = _read_file(table, len(rows), folder, "row of C")
    if source == "simulated" and file is not None:
        table.wrong("source", 'is "simulated", but a file is given; remove one of the two')
    if source == "file" and file is None and "file" not in table.values:
        table.wrong("file", 'is missing; source = "file" needs the path of a CSV file')
    simulated = tuple(table.vector("simulated_r", []))
    if simulated and (source == "file" or len(simulated) != len(rows) or min(simulated) < 0):
        table.wrong(
            "simulated_r", f'expected {len(rows)} half-widths ≥ 0, source = "simulated"; found {list(simulated)}'
        )
    faults = tuple(_read_fault(item) for item in table.tables("faults"))
    if faults and source == "file":
        table.wrong("faults", "faults are simulated, a sensor that plays a file has none; remove the key")
    table.finish()
    return SensorSettings(name, tuple(map(tuple, rows)), tuple(widths), tuple(outputs), file, faults, simulated)


def _read_fault(table: Table) -> SensorFault:
    kind = table.choice("kind", FAULTS, REQUIRED)
    first, last = table.whole("from", 1, low=1), table.whole("to", 2**53, low=1)
    if first > last:
        table.wrong("to", f"is {last}, before from = {first}")
    size = table.number("size", 1.0)
    table.finish()
    return SensorFault("bias" if kind is REQUIRED else kind, first, last, size)


def _read_file(table: Table, count: int, folder: Path, per: str) -> MeasurementFileSettings | None:
    """The keys ``file``, ``columns`` and ``time`` or ``step``; the file itself is read and checked too."""
    text = table.text("file", None)
    columns = table.texts("columns", None)
    by_time, by_step = table.text("time", None), table.text("step", None)
    if text is None:
        for key in ("columns", "time", "step"):
            if key in table.values:
                table.wrong(key, "has no effect without file = the path of a CSV file")
        return None
    if by_time is not None and by_step is not None:
        table.wrong("step", "give either time or step, the name of the column that orders the rows, not both")
    index, indexed_by = (by_time, "time") if by_time is not None else (by_step or "step", "step")
    if columns is not None and len(columns) != count:
        table.wrong("columns", f"expected {count} column names, one per {per}, found {len(columns)}")
        columns = None
    path = file_at(text, folder)
    settings = MeasurementFileSettings(path, tuple(columns or ()), index, indexed_by)
    if not table.problems.reads_files:
        return settings
    try:
        header = read_columns(settings, default_count=count).columns
    except FileProblems as error:
        table.problems.lines.extend(error.lines)
        return settings
    return MeasurementFileSettings(path, header, index, indexed_by)


def read_filter(
    table: Table,
    name: str,
    sensors: Mapping[str, SensorSettings],
    model: LSUModel | None,
    prior: Orthotope | None,
    peers: Mapping[str, Collection[str]],
) -> FilterSettings:
    """``[filters.NAME]``; the filter is made once, so that the class checks its own options.

    ``peers`` holds the names of all ``filters`` and ``fusion`` tables.
    """
    kind = table.choice("kind", tuple(FILTERS), REQUIRED)
    chosen = _read_names(table, "sensors", sensors)
    deadline = table.duration("deadline", 0.05)
    history = table.whole("history", 32, low=1, high=4096)
    transfer = table.choice("transfer", TRANSFERS, "off")
    senders = _read_senders(table, name, transfer, peers)
    on_contradiction = table.choice("on_contradiction", CONTRADICTIONS, "reset")
    reset_after = table.whole("reset_after", 5, low=1)
    adopt = _read_adopt(table, peers["identifier"], model)
    options = table.rest()
    if isinstance(kind, str) and kind in FILTERS:
        _check_options(table, kind, options, sensors, chosen, model, prior)
    return FilterSettings(
        name,
        str(kind),
        chosen,
        deadline,
        history,
        transfer,
        senders,
        on_contradiction,
        reset_after,
        options,
        adopt,
    )


def _read_adopt(table: Table, identifiers: Collection[str], model: LSUModel | None) -> str:
    """``adopt``: adoption starts again from the domain, so there must be one."""
    adopt = table.text("adopt", None)
    if adopt is None:
        return ""
    if adopt not in identifiers:
        table.wrong("adopt", f'there is no identifier "{adopt}"; {nearest(adopt, identifiers)}')
    elif model is not None and model.domain is None:
        table.wrong("adopt", "adopting bounds starts again from the domain; give [model.domain]")
    return str(adopt)


def _read_senders(
    table: Table, name: str, transfer: TransferWay, peers: Mapping[str, Collection[str]]
) -> tuple[str, ...]:
    """``transfer_from``: by default all other filters, or for fused boxes all fusions."""
    known = peers["fusion"] if transfer == "fused" else [other for other in peers["filters"] if other != name]
    given = table.texts("transfer_from", None)
    if transfer == "off":
        if given:
            table.wrong("transfer_from", 'has no effect with transfer = "off"; remove it or choose a transfer')
        return ()
    for other in given or ():
        if other not in known:
            table.wrong("transfer_from", f'"{other}" cannot be transferred from; {nearest(other, known)}')
    senders = tuple(sorted(set(known if given is None else given)))
    if not senders:
        table.wrong("transfer", f'"{transfer}" has nobody to come from')
    return senders


_OWN = (
    "kind", "sensors", "deadline", "history", "transfer", "transfer_from", "on_contradiction", "reset_after",
    "adopt",
)  # fmt: skip


def _check_options(
    table: Table,
    kind: str,
    options: Mapping[str, object],
    sensors: Mapping[str, SensorSettings],
    chosen: tuple[str, ...],
    model: LSUModel | None,
    prior: Orthotope | None,
) -> None:
    cls = filter_class(kind)
    known = [key for key in inspect.signature(cls).parameters if key not in ("model", "prior")]
    for key in known:
        table.problems.asked.add(f"{table.path}.{key}")
    unknown = [key for key in options if key not in known]
    for key in unknown:
        table.wrong(key, f"unknown key; {nearest(key, [*_OWN, *known])}")
    if unknown or model is None or prior is None or table.problems.lines:
        return
    rows = [row for name in chosen for row in sensors[name].C]
    widths = [width for name in chosen for width in sensors[name].r]
    try:
        cls(model.replace(C=rows, r=widths), prior, **options)  # type: ignore[call-arg]
    except (ModelError, TypeError) as error:
        table.problems.add(f"[{table.path}]", str(error))


def read_fusion(
    table: Table, name: str, filters: Mapping[str, FilterSettings], peers: Mapping[str, Collection[str]]
) -> FusionSettings:
    """``[fusion.NAME]``; sources are filters and other fusions."""
    known = dict.fromkeys(other for other in (*filters, *peers["fusion"]) if other != name)
    sources = _read_names(table, "sources", known)
    policy = table.choice("policy", tuple(POLICIES), "intersect")
    faults = table.whole("faults", 0)
    chosen = POLICIES[policy]
    if faults and not chosen.takes_faults:
        others = " or ".join(f'"{other.name}"' for other in POLICIES.values() if other.takes_faults)
        table.wrong("faults", f'is {faults}, but policy = "{policy}" trusts every source; set policy = {others}')
    elif sources and len(sources) < chosen.sources_needed(faults):
        table.wrong("faults", f"is {faults} of {len(sources)} sources; at least one source must be right")
    max_lag = table.whole("max_lag", 16, low=0, high=4096)
    deadline = table.duration("deadline", 0.05)
    quarantine_after = table.whole("quarantine_after", 20, low=1)
    max_generators = table.whole("max_generators", 30, low=1, high=1000)
    max_constraints = table.whole("max_constraints", 12, low=0, high=500)
    table.finish()
    return FusionSettings(
        name, sources, policy, faults, max_lag, deadline, quarantine_after, max_generators, max_constraints
    )


def read_identifier(table: Table, name: str, sensors: Mapping[str, SensorSettings]) -> IdentifierSettings:
    """``[identifier.NAME]``."""
    chosen = _read_names(table, "sensors", sensors)
    learn = table.choice("learn", LEARNS, "both")
    window = table.whole("window", 200, low=2, high=100_000)
    every = table.whole("every", 50, low=1)
    margin = table.number("margin", 1.2)
    if margin < 1.0:
        table.wrong("margin", f"expected at least 1, found {margin:g}")
    lead = table.whole("lead", 20, low=1)
    table.finish()
    return IdentifierSettings(name, chosen, learn, window, every, margin, lead)


def is_guaranteed(kind: object) -> bool:
    """Whether the sets of filters of this kind hold the state as long as the bounds do."""
    return not isinstance(kind, str) or kind not in FILTERS or filter_class(kind).guarantee == "declared"


def check_learning(
    filters: Mapping[str, FilterSettings],
    fusion: Mapping[str, FusionSettings],
    identifiers: Mapping[str, IdentifierSettings],
    sound: Collection[str],
    problems: Problems,
) -> None:
    """A fusion intersects guaranteed sets only, those of ``sound`` filters, and predicts with the declared rho."""
    for settings in fusion.values():
        for source in settings.sources:
            if source not in filters:
                continue
            one = filters[source]
            if source not in sound:
                text = f'"{source}" is a {one.kind}, whose sets are estimates; a fusion intersects guaranteed sets only'
                problems.add(f"[fusion.{settings.name}] sources", text)
            if one.adopt in identifiers and identifiers[one.adopt].learn != "r":
                text = f'its rho may change, the fusion "{settings.name}" would not know; set learn = "r" there'
                problems.add(f"[filters.{source}] adopt", text)
    for one in filters.values():
        lacking = set(one.sensors) - set(identifiers[one.adopt].sensors) if one.adopt in identifiers else set()
        if lacking:
            text = f'"{one.adopt}" does not listen to {", ".join(sorted(lacking))}, whose r the filter needs'
            problems.add(f"[filters.{one.name}] adopt", text)


def _read_names(table: Table, key: str, known: Mapping[str, object]) -> tuple[str, ...]:
    names = table.texts(key)
    if not isinstance(names, list):
        return ()
    if not names:
        table.wrong(key, f"is empty; {nearest('', known)}")
    for name in names:
        if name not in known:
            table.wrong(key, f'"{name}" is not defined; {nearest(name, known)}')
        elif names.count(name) > 1:
            table.wrong(key, f'"{name}" is named twice')
    return tuple(sorted({name for name in names if name in known}))


def shared_sensor_warnings(filters: Mapping[str, FilterSettings], fusion: Mapping[str, FusionSettings]) -> list[str]:
    """A sensor that feeds several sources of a relaxed fusion makes that many of them lie at once."""
    warnings = []
    for settings in fusion.values():
        if not POLICIES[settings.policy].takes_faults:
            continue
        fed: dict[str, list[str]] = {}
        for source in settings.sources:
            for sensor in filters[source].sensors if source in filters else ():
                fed.setdefault(sensor, []).append(source)
        for sensor, sources in sorted(fed.items()):
            if len(sources) > settings.faults:
                warnings.append(
                    f"[fusion.{settings.name}] faults = {settings.faults}, but sensor {sensor!r} feeds {len(sources)} "
                    f"sources ({', '.join(sources)}); if it lies, all of them do"
                )
        warnings += [
            f"[fusion.{settings.name}] source {source!r} takes transfers, so a liar may reach it; "
            'use transfer = "off", or the fused box of this fusion'
            for source in settings.sources
            if source in filters and filters[source].transfer in ("predictor", "data-predictor")
        ]
    return warnings
