"""``instances`` of filters and ``[model.instances]``: what a mesh of banks has, and what it cannot have."""

from __future__ import annotations

import zipfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.bank_messages import MAX_BANK_PAYLOAD, MAX_INSTANCES
from lsu_mesh.mesh.config.expected import MATRIX, Expected, Unfit, as_whole, each, shown
from lsu_mesh.mesh.config.instances import OWN_KEYS, Instances
from lsu_mesh.mesh.config.problem import Problems
from lsu_mesh.mesh.config.settings import FilterSettings, FusionSettings, PlantSettings, SensorSettings
from lsu_mesh.mesh.config.system import System
from lsu_mesh.mesh.config.table import Table, file_at

TABLE = "model.instances"
FIXED_BYTES = 1 << 16
"""Room for what a message holds besides its arrays."""


class Others:
    """The tables of a mesh that a bank looks at, besides filters and sensors."""

    def __init__(
        self, plant: PlantSettings | None, fusion: Mapping[str, FusionSettings], identifiers: Collection[str]
    ) -> None:
        self.plant, self.fusion, self.identifiers = plant, fusion, identifiers


def read_instance_count(table: Table) -> int:
    """``instances`` of a filter; 0 where it is no bank."""
    return table.read("instances", 0, Expected(f"a whole number from 1 to {MAX_INSTANCES}", _as_count))


def _as_count(value: Any) -> int:
    try:
        return as_whole(value, 1, MAX_INSTANCES)
    except Unfit as unfit:
        is_none = value == 0 and not isinstance(value, bool)
        raise Unfit(unfit.remedy or ("remove the key where one target is estimated" if is_none else "")) from None


def read_instances(
    system: System,
    filters: Mapping[str, FilterSettings],
    sensors: Mapping[str, SensorSettings],
    others: Others,
    folder: Path,
    problems: Problems,
) -> Instances | None:
    """The instances of the mesh's banks, after all that a mesh of banks cannot have was noted; ``None``: no bank."""
    table = system.instances
    counts = {name: one.instances for name, one in filters.items() if one.instances}
    if not counts:
        if table is not None:
            remedy = "remove it, or give every filter instances = N"
            problems.add(TABLE, "", f"has no effect without a bank; {remedy}", expected="filters with instances")
            note_keys(table)
        _check_faults(sensors, 0, problems)
        return None
    if not _check_counts(filters, counts, problems):
        if table is not None:
            note_keys(table)
        return None
    _check_parts(system, filters, sensors, others, problems=problems)
    count = next(iter(counts.values()))
    _check_faults(sensors, count, problems)
    found = _read_table(table, count, system, folder) if table is not None else Instances(count)
    _check_banks(filters, sensors, found, system, problems=problems)
    return found


def note_keys(table: Table) -> None:
    """Note that the schema has the keys of ``[model.instances]``."""
    for key in ("file", *OWN_KEYS):
        table.problems.asked.add(f"{table.path}.{key}")


def _check_counts(filters: Mapping[str, FilterSettings], counts: Mapping[str, int], problems: Problems) -> bool:
    """Whether all filters are banks of as many instances: the plant simulates one set of targets."""
    first, count = next(iter(counts.items()))
    single = next((name for name, one in filters.items() if not one.instances), None)
    for name, found in counts.items():
        if single is not None and not problems.are_in(f"filters.{single}", "instances"):
            text = f"is {found}, and [filters.{single}] is a single filter: all filters of a mesh are banks, or none"
            remedy = f"instances = {found} there too, or none here"
        elif found != count:
            text = f"is {found}, and [filters.{first}] has {count}: all banks of a mesh have as many instances"
            remedy = f"instances = {count}"
        else:
            continue
        problems.add(f"filters.{name}", "instances", f"{text}; {remedy}", expected=remedy, found=str(found))
    return single is None and set(counts.values()) == {count}


def _check_faults(sensors: Mapping[str, SensorSettings], count: int, problems: Problems) -> None:
    for sensor in sensors.values():
        for i, fault in enumerate(sensor.faults):
            table, beyond = f"sensors.{sensor.name}.faults[{i}]", [one for one in fault.instances if one >= count]
            if beyond and not count:
                text = "has no effect: the mesh has no bank; remove it"
                problems.add(table, "instances", text, expected="no such key here", found=shown(list(fault.instances)))
            elif beyond:
                text = f"names instance {beyond[0]}; the bank has instances 0 to {count - 1}"
                expected = f"whole numbers from 0 to {count - 1}"
                problems.add(table, "instances", text, expected=expected, found=shown(list(fault.instances)))


def _check_parts(
    system: System,
    filters: Mapping[str, FilterSettings],
    sensors: Mapping[str, SensorSettings],
    others: Others,
    problems: Problems,
) -> None:
    for table, key, text, remedy in (
        *_of_model(system),
        *(one for settings in filters.values() if settings.instances for one in _of_filter(settings)),
        *(one for sensor in sensors.values() for one in _of_sensor(sensor)),
        *_of_others(others, filters),
    ):
        problems.add(table, key, f"{text}; {remedy}", expected=remedy)


Refusal = tuple[str, str, str, str]
"""Table, key, sentence and remedy."""


def _of_model(system: System) -> Iterator[Refusal]:
    if system.model is not None and system.model.input_count:
        yield "model", "B", "a bank takes no inputs", "remove B, and let rho hold what drives the targets"
    if system.is_continuous:
        yield "model", "continuous", "a bank goes by steps, not by times", "give the discrete model of a step"
    if system.schedule:
        yield "model", "schedule", "a bank keeps one model", "remove the schedule"


def _of_filter(one: FilterSettings) -> Iterator[Refusal]:
    table = f"filters.{one.name}"
    if one.transfer != "off":
        text = f'is "{one.transfer}", and a bank takes no transfers: each target would need a set of its own for it'
        yield table, "transfer", text, 'set "off"'
    if one.adopt:
        yield table, "adopt", "a bank adopts no bounds", "remove it"
    if one.on_inconsistency == "widen":
        yield table, "on_inconsistency", 'is "widen", and a bank does not widen', 'set "reset" or "hold"'


def _of_sensor(sensor: SensorSettings) -> Iterator[Refusal]:
    table = f"sensors.{sensor.name}"
    if sensor.source in ("file", "ros2"):
        text = f'"{sensor.source}" has data of one target, and the sensor feeds a bank'
        yield table, "source", text, 'set "simulated" or "external"'
    parts: dict[str, object] = {"D": sensor.D, "offset": sensor.offset, "period": sensor.period, "rate": sensor.rate}
    parts |= {"time_error": sensor.time_error_ns, "every": sensor.every_ns}
    parts |= {"off_grid": sensor.off_grid != "refuse", "clock_error": sensor.clock_error_ns}
    for key, value in parts.items():
        if value:
            yield table, key, "a bank uses plain outputs C x at its steps", f"remove {key}"


def _of_others(others: Others, filters: Mapping[str, FilterSettings]) -> Iterator[Refusal]:
    if others.plant is not None and others.plant.x1 is not None:
        yield "plant", "x1", "is the state of one target", "give x1 in [model.instances], or leave it out"
    if others.plant is not None and (others.plant.file is not None or others.plant.is_external):
        yield "plant", "source", "a bank takes no inputs", "remove the source of inputs"
    for name in others.identifiers:
        yield f"identifier.{name}", "", "nobody identifies bounds from the data of a bank", "remove the table"
    for one in others.fusion.values():
        table = f"fusion.{one.name}"
        if one.policy != "intersect":
            yield table, "policy", f'is "{one.policy}", and banks are intersected', 'set "intersect"'
        nested = [source for source in one.sources if source not in filters]
        if nested:
            yield table, "sources", f"{', '.join(nested)}: a fusion of banks takes banks", "name filters only"


def _check_banks(
    filters: Mapping[str, FilterSettings],
    sensors: Mapping[str, SensorSettings],
    found: Instances,
    system: System,
    problems: Problems,
) -> None:
    """Each bank is made once with one instance, so that the class says what it cannot do; and its message has room."""
    from lsu_mesh.filters.bank import FilterBank
    from lsu_mesh.filters.registry import filter_class

    for name, one in filters.items():
        table = f"filters.{name}"
        if not one.instances or system.model is None or system.prior is None or problems.are_in(table):
            continue
        chosen = [sensors[sensor] for sensor in one.sensors]
        rows, widths = [row for sensor in chosen for row in sensor.C], [r for sensor in chosen for r in sensor.r]
        try:
            model: Any = system.model.replace(C=rows, r=widths)
            kind: Any = filter_class(one.kind)
            bank = FilterBank(kind, model, [system.prior], threads=1, **one.options)
        except ModelError as error:
            if problems.records:
                continue
            text = f'"{one.kind}" cannot be a bank: {error}; use LSUO, LSUP or LSUPB, or remove instances'
            problems.add(table, "kind", text, expected="a kind with a compiled bank, such as LSUO")
            continue
        n = model.state_count
        numbers = 3 * n + 1 + (0 if bank.kind.__name__ == "LSUO" else n * (n + 1))
        size = found.count * (8 * numbers + 1) + FIXED_BYTES
        if size > MAX_BANK_PAYLOAD:
            most = (MAX_BANK_PAYLOAD - FIXED_BYTES) // (8 * numbers + 1)
            text = f"is {found.count}, and a message of {n} states has room for {most} of them; make several meshes"
            problems.add(table, "instances", text, expected=f"a whole number ≤ {most}")


def _read_table(table: Table, count: int, system: System, folder: Path) -> Instances:
    """``[model.instances]``: arrays in the file itself, or in a file of NumPy."""
    own: dict[str, Any] = {
        "lower": table.matrix("lower", None),
        "upper": table.matrix("upper", None),
        "A": table.read("A", [], each("a list of matrices, one per instance", MATRIX)) or None,
        "rho": table.matrix("rho", None),
        "x1": table.matrix("x1", None),
    }
    path = table.text("file", None)
    table.finish()
    arrays: dict[str, Array] = {}
    for key, value in own.items():
        if value is not None:
            try:
                arrays[key] = np.array(value, dtype=np.float64)
            except ValueError:
                table.wrong(key, "the matrices differ in shape; all instances have equal shapes", "equal shapes")
    if path is not None:
        for key, array in _read_file(table, file_at(path, folder)).items():
            if key in arrays:
                table.wrong(key, f"is here and in {path} too; remove one of the two", "each part once")
            arrays[key] = array
    return Instances(count, **_checked(table, arrays, count, system, path=path))


def _checked(table: Table, arrays: dict[str, Array], count: int, system: System, path: str | None) -> dict[str, Array]:
    """The arrays whose shapes and numbers fit."""
    n, q = system.state_count or 0, 0 if system.model is None else system.model.rho.size
    shapes = {"lower": (n,), "upper": (n,), "x1": (n,), "rho": (q,), "A": (n, n)}
    found = {}
    for key, array in arrays.items():
        place = key if key in table.values else "file"
        what = "" if place == key else f"{key} in {path}: "
        if array.shape != (count, *shapes[key]) and system.model is not None:
            expected = f"shape {(count, *shapes[key])}, one row per instance"
            table.wrong(place, f"{what}expected {expected}, found {array.shape}", expected)
        elif not np.isfinite(array).all():
            table.wrong(place, f"{what}holds a number that is not finite", "finite numbers")
        elif key == "rho" and (array < 0).any():
            row = int((array < 0).any(axis=1).argmax())
            table.wrong(place, f"{what}row {row} has a negative half-width", "half-widths ≥ 0")
        else:
            found[key] = array
    lower, upper = found.get("lower"), found.get("upper")
    if ("lower" in arrays) != ("upper" in arrays):
        place = "lower" if "lower" in table.values or "upper" in table.values else "file"
        table.wrong(place, "lower and upper of the priors come together", "both, or none")
    if lower is not None and upper is not None and (lower > upper).any():
        row = int((lower > upper).any(axis=1).argmax())
        place = "lower" if "lower" in table.values else "file"
        table.wrong(place, f"lower > upper in row {row}", "lower ≤ upper in every row")
    return found


def _read_file(table: Table, path: Path) -> dict[str, Array]:
    """The arrays of an ``.npz`` file."""
    listed = ", ".join(OWN_KEYS)
    expected = f"a NumPy file .npz with arrays of the names {listed}"
    try:
        with np.load(path, allow_pickle=False) as content:
            if not isinstance(content, np.lib.npyio.NpzFile):
                raise ValueError("it holds one array without a name")
            arrays = {name: np.array(content[name]) for name in content.files}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        table.wrong("file", f"{shown(str(path))} cannot be read: {error}; expected {expected}", expected)
        return {}
    unknown: Sequence[str] = [name for name in arrays if name not in OWN_KEYS]
    numeric = {name: array for name, array in arrays.items() if array.dtype.kind in "fiu" and name not in unknown}
    if unknown or len(numeric) < len(arrays):
        names = ", ".join(sorted({*unknown, *(set(arrays) - set(numeric))}))
        table.wrong("file", f"{shown(str(path))} holds {names}; expected {expected}", expected)
    return {name: array.astype(np.float64) for name, array in numeric.items()}
