"""From a TOML file to a :class:`Configuration`, or to all of its mistakes at once.

Precedence: flag (``-X table.key=value``) > environment (``LSU_MESH_TABLE__KEY``) > file > default.
"""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from fractions import Fraction
from pathlib import Path
from typing import Any

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config.network import check_reserved, open_endpoint_warnings, read_network
from lsu_mesh.mesh.config.peers import (
    check_learning,
    is_guaranteed,
    read_filter,
    read_fusion,
    read_identifier,
    read_plant,
    read_sensor,
    shared_sensor_warnings,
)
from lsu_mesh.mesh.config.settings import (
    Configuration,
    MeshSettings,
    RecorderSettings,
    SupervisorSettings,
)
from lsu_mesh.mesh.config.system import read_model
from lsu_mesh.mesh.config.table import ConfigurationError, Problems, Table
from lsu_mesh.mesh.data_files.moments import start_time_ns
from lsu_mesh.mesh.keys import NAME_RULE, is_name

ENVIRONMENT_PREFIX = "LSU_MESH_"


def load(
    path: Path,
    overrides: Sequence[str] = (),
    environment: Mapping[str, str] | None = None,
    *,
    reads_files: bool = True,
) -> Configuration:
    """Read and check a configuration; files of measurements are looked into only if ``reads_files``.

    Raises
    ------
    ConfigurationError
        With one line per mistake: file, table, key, what was expected, the nearest valid name.
    """
    problems = Problems(str(path), reads_files=reads_files)
    return _load(path, overrides, environment, problems)


def load_with_keys(
    path: Path, overrides: Sequence[str] = (), environment: Mapping[str, str] | None = None
) -> tuple[Configuration, set[str]]:
    """The configuration and the paths of all keys that the schema knows for it."""
    problems = Problems(str(path))
    return _load(path, overrides, environment, problems), problems.asked


def _load(
    path: Path, overrides: Sequence[str], environment: Mapping[str, str] | None, problems: Problems
) -> Configuration:
    values = _read_toml(path)
    _apply(values, _from_environment(environment or {}), "environment", problems)
    _apply(values, [_split(text) for text in overrides], "-X", problems)
    return _checked(values, path, problems)


def load_values(
    values: Mapping[str, Any], path: Path, overrides: Sequence[str] = (), *, reads_files: bool = True
) -> Configuration:
    """A configuration from the TOML values themselves, as :attr:`Configuration.values` holds them.

    ``path`` stands in messages, and paths in the values start from its folder. Files of measurements are looked into
    only if ``reads_files``: those of a recorded run may be gone. Raises :class:`ConfigurationError`.
    """
    problems, copied = Problems(str(path), reads_files=reads_files), copy.deepcopy(dict(values))
    _apply(copied, [_split(text) for text in overrides], "-X", problems)
    return _checked(copied, path, problems)


def _checked(values: dict[str, Any], path: Path, problems: Problems) -> Configuration:
    _spell_out_dates(values)
    original = copy.deepcopy(values)
    configuration = _read(values, path, problems)
    problems.raise_if_any()
    assert configuration is not None
    return replace(configuration, values=original)


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError([f"{path}: not a TOML file: {error}"]) from None
    except UnicodeDecodeError as error:
        raise ConfigurationError([f"{path}: not UTF-8 text: {error}"]) from None
    except OSError as error:
        raise ConfigurationError([f"{path}: cannot be read: {error.strerror}"]) from None


def _split(text: str) -> tuple[str, str]:
    key, sign, value = text.partition("=")
    if not sign:
        raise ConfigurationError([f"-X {text}: expected table.key=value, such as mesh.steps=100"])
    return key.strip(), value.strip()


def _from_environment(environment: Mapping[str, str]) -> list[tuple[str, str]]:
    return [
        (name.removeprefix(ENVIRONMENT_PREFIX).lower().replace("__", "."), value)
        for name, value in sorted(environment.items())
        if name.startswith(ENVIRONMENT_PREFIX) and "__" in name
    ]


def _apply(values: dict[str, Any], changes: Sequence[tuple[str, str]], source: str, problems: Problems) -> None:
    for key, text in changes:
        *tables, last = key.split(".")
        table: Any = values
        for name in tables:
            table = table.setdefault(name, {}) if isinstance(table, dict) else None
        if not isinstance(table, dict) or not tables:
            problems.add(f"{source} {key}", "expected table.key=value, such as mesh.steps=100")
            continue
        try:
            table[last] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            table[last] = text  # a bare word is a string


def _read(values: dict[str, Any], path: Path, problems: Problems) -> Configuration | None:
    root = Table(values, "", problems)
    mesh = _read_mesh(root)
    system = read_model(root.table("model", required=True), problems)
    model, prior, input_box = system.model, system.prior, system.input_box
    sensors = {
        name: read_sensor(table, name, system.state_count, path.parent)
        for name, table in _named(root, "sensors", problems).items()
    }
    plant = read_plant(root.table("plant"), model, sensors, path.parent, problems)
    filter_tables, fusion_tables = _named(root, "filters", problems), _named(root, "fusion", problems)
    identifier_tables = _named(root, "identifier", problems)
    sound = [name for name, table in filter_tables.items() if is_guaranteed(table.values.get("kind"))]
    peers = {"filters": sound, "fusion": list(fusion_tables), "identifier": list(identifier_tables)}
    filters = {name: read_filter(table, name, sensors, model, prior, peers) for name, table in filter_tables.items()}
    fusion = {name: read_fusion(table, name, filters, peers) for name, table in fusion_tables.items()}
    identifiers = {name: read_identifier(table, name, sensors) for name, table in identifier_tables.items()}
    check_learning(filters, fusion, identifiers, sound, problems)
    recorder, network = _read_recorder(root), read_network(root)
    supervisor = _read_supervisor(root)
    root.finish()
    names = [*sensors, *filters, *fusion, *identifiers, *([plant.name] if plant else []), "recorder"]
    _check_names(names, problems)
    check_reserved(network, names, problems)
    if any(s.file and s.file.indexed_by == "time" for s in sensors.values()) and mesh.start_time is None:
        problems.add("[mesh] start_time", "is missing; files with a time column need it: step = (t − start_time)/dt")
    if model is None or prior is None:
        if not problems.lines:
            problems.add("[model]", "no model could be made")
        return None
    return Configuration(
        path, mesh, model, prior, input_box, plant, dict(sorted(sensors.items())), dict(sorted(filters.items())),
        dict(sorted(fusion.items())), recorder, network, supervisor,
        (*shared_sensor_warnings(filters, fusion), *open_endpoint_warnings(network)),
        identifiers=dict(sorted(identifiers.items())),
    )  # fmt: skip


def _read_mesh(root: Table) -> MeshSettings:
    table = root.table("mesh", required=True) or Table({"name": "mesh", "dt": 1.0}, "mesh", root.problems)
    name = table.text("name")
    if isinstance(name, str) and not is_name(name):
        table.wrong("name", f'"{name}" is no name; expected {NAME_RULE}')
    dt = table.number("dt", above=0.0)
    steps = table.whole("steps", None, low=1)
    seed = table.whole("seed", 1)
    rate = table.number("rate", 1.0 / dt if isinstance(dt, float) else 1.0, above=0.0)
    start_time = table.read("start_time", None, "seconds, or a moment such as 2024-05-01T12:00:00Z", _start_seconds)
    table.finish()
    return MeshSettings(name, dt, steps, seed, rate, start_time)


def _spell_out_dates(values: dict[str, Any]) -> None:
    """``start_time`` as ISO text: the values are recorded, and a recording holds no dates of TOML."""
    mesh = values.get("mesh")
    if isinstance(mesh, dict) and isinstance(mesh.get("start_time"), date):
        mesh["start_time"] = mesh["start_time"].isoformat()


def _start_seconds(value: object) -> float | None:
    try:
        return float(Fraction(start_time_ns(value)[0], 10**9))
    except ModelError:
        return None


def _named(root: Table, key: str, problems: Problems) -> dict[str, Table]:
    outer = root.table(key)
    if outer is None:
        return {}
    named = {}
    for name, values in outer.values.items():
        if is_name(name):
            named[name] = Table(values, f"{key}.{name}", problems)
        else:
            problems.add(f"[{key}.{name}]", f'"{name}" is no name; expected {NAME_RULE}')
    return named


def _read_recorder(root: Table) -> RecorderSettings:
    table = root.table("recorder")
    if table is None:
        return RecorderSettings()
    path = table.text("path", RecorderSettings.path)
    flush = table.duration("flush", RecorderSettings.flush, low=0.01)
    mesh_hz = table.number("mesh_hz", RecorderSettings.mesh_hz, above=0.0)
    axes = tuple(table.texts("axes", []))
    table.finish()
    return RecorderSettings(path, flush, mesh_hz, axes)


def _read_supervisor(root: Table) -> SupervisorSettings:
    table = root.table("supervisor")
    if table is None:
        return SupervisorSettings()
    restart = table.flag("restart", SupervisorSettings.restart)
    backoff = table.duration("backoff", SupervisorSettings.backoff)
    limit = table.whole("limit", SupervisorSettings.limit)
    table.finish()
    return SupervisorSettings(restart, backoff, limit)


def _check_names(names: Sequence[str], problems: Problems) -> None:
    for name in sorted({name for name in names if names.count(name) > 1}):
        problems.add("", f'two peers are called "{name}"; every peer of a mesh needs a name of its own')
