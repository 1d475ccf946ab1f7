"""From a TOML file to a :class:`Configuration`, or to all of its mistakes at once.

Precedence: flag (``-X table.key=value``) > environment (``LSU_MESH_TABLE__KEY``) > file > default.
"""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lsu_mesh.mesh.config.bank import Others, read_instances
from lsu_mesh.mesh.config.exact_times import keep_digits, spell_out_dates
from lsu_mesh.mesh.config.expected import shown
from lsu_mesh.mesh.config.filters import kind_of, read_filter
from lsu_mesh.mesh.config.fusion import check_learning, read_fusion, read_identifier, shared_sensor_warnings
from lsu_mesh.mesh.config.live_sources import (
    check_external_plant,
    input_delay_ns,
    live_source_warnings,
    settle_start,
)
from lsu_mesh.mesh.config.mesh_table import START_TIME, grid_of_table, read_mesh
from lsu_mesh.mesh.config.network import check_reserved, open_endpoint_warnings, read_network
from lsu_mesh.mesh.config.overrides import apply, from_environment, from_flags
from lsu_mesh.mesh.config.problem import ConfigurationError, Problem, Problems
from lsu_mesh.mesh.config.ros2 import check_ros2, ros2_warnings
from lsu_mesh.mesh.config.sensors import read_plant, read_sensor
from lsu_mesh.mesh.config.settings import (
    Configuration,
    RecorderSettings,
    SupervisorSettings,
)
from lsu_mesh.mesh.config.system import read_model
from lsu_mesh.mesh.config.table import Table
from lsu_mesh.mesh.config.toml_lines import key_lines
from lsu_mesh.mesh.keys import NAME_RULE, is_name


def load(
    path: Path,
    overrides: Sequence[str] = (),
    environment: Mapping[str, str] | None = None,
    *,
    reads_files: bool = True,
    makes_filters: bool = True,
) -> Configuration:
    """Read and check a configuration.

    Files of measurements are looked into only if ``reads_files``. Each filter is made once, so that its class checks
    its own options, only if ``makes_filters``: that loads kernels, which a process without filters does not need.

    Raises
    ------
    ConfigurationError
        With one record per mistake: file, table, key, what was found and expected, the nearest valid name, the line.
    """
    return _load(path, overrides, environment, reads_files=reads_files, makes_filters=makes_filters)[0]


def load_with_keys(
    path: Path, overrides: Sequence[str] = (), environment: Mapping[str, str] | None = None
) -> tuple[Configuration, set[str]]:
    """The configuration and the paths of all keys that the schema knows for it."""
    return _load(path, overrides, environment)


def _load(
    path: Path,
    overrides: Sequence[str],
    environment: Mapping[str, str] | None,
    *,
    reads_files: bool = True,
    makes_filters: bool = True,
) -> tuple[Configuration, set[str]]:
    text = _read_text(path)
    values = _read_toml(path, text)
    problems = Problems(str(path), reads_files=reads_files, makes_filters=makes_filters, lines=key_lines(text))
    apply(values, from_environment(environment or {}), problems)
    apply(values, from_flags(overrides, problems), problems)
    return _checked(values, path, problems), problems.asked


def load_values(
    values: Mapping[str, Any], path: Path, overrides: Sequence[str] = (), *, reads_files: bool = True
) -> Configuration:
    """A configuration from the TOML values themselves, as :attr:`Configuration.values` holds them.

    ``path`` stands in messages, and paths in the values start from its folder. Files of measurements are looked into
    only if ``reads_files``: those of a recorded run may be gone. Raises :class:`ConfigurationError`.
    """
    problems, copied = Problems(str(path), reads_files=reads_files), copy.deepcopy(dict(values))
    apply(copied, from_flags(overrides, problems), problems)
    return _checked(copied, path, problems)


def _checked(values: dict[str, Any], path: Path, problems: Problems) -> Configuration:
    spell_out_dates(values)
    original = copy.deepcopy(values)
    configuration = _read(values, path, problems)
    problems.raise_if_any()
    assert configuration is not None
    return replace(configuration, values=original)


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise _unreadable(path, f"not UTF-8 text: {error}", "UTF-8 text") from None
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        text = f"cannot be read: {getattr(error, 'strerror', None) or error}"
        raise _unreadable(path, text, "a file that can be read") from None


def _read_toml(path: Path, text: str) -> dict[str, Any]:
    try:
        values = tomllib.loads(text)
        keep_digits(values, text)
        return values
    except RecursionError:
        raise _unreadable(path, "not a TOML file: lists or tables are nested too deep", "a TOML file") from None
    except ValueError as error:  # TOMLDecodeError, or a whole number with too many digits for Python
        place = re.search(r"\(at line ([0-9]+), column [0-9]+\)", str(error))
        ends = "(at end of document)" in str(error)
        line = int(place[1]) if place else text.count("\n") + 1 if ends else None
        raise _unreadable(path, f"not a TOML file: {error}", "a TOML file", line) from None


def _unreadable(path: Path, text: str, expected: str, line: int | None = None) -> ConfigurationError:
    return ConfigurationError([Problem(file=str(path), table="", key="", text=text, expected=expected, line=line)])


def _read(values: dict[str, Any], path: Path, problems: Problems) -> Configuration | None:
    root = Table(values, "", problems)
    mesh = read_mesh(root)
    grid = grid_of_table(mesh, problems)
    system = read_model(root.table("model", required=True), problems, grid)
    model, prior, input_box = system.model, system.prior, system.input_box
    sensor_tables = _named(root, "sensors", problems)
    sensors = {n: read_sensor(t, n, system, path.parent) for n, t in sensor_tables.items()}
    plant = read_plant(root.table("plant"), model, sensors, folder=path.parent, problems=problems)
    filter_tables, fusion_tables = _named(root, "filters", problems), _named(root, "fusion", problems)
    identifier_tables = _named(root, "identifier", problems)
    kinds = {name: kind_of(table) for name, table in filter_tables.items()}
    sound = [name for name, kind in kinds.items() if kind.is_guaranteed]
    peers = {"filters": sound, "fusion": list(fusion_tables), "identifier": list(identifier_tables)}
    filters = {
        name: read_filter(table, name, kinds[name], sensors=sensors, system=system, peers=peers)
        for name, table in filter_tables.items()
    }
    fusion = {name: read_fusion(table, name, filters, peers) for name, table in fusion_tables.items()}
    identifiers = {name: read_identifier(table, name, sensors) for name, table in identifier_tables.items()}
    check_learning(filters, fusion, identifiers, sound=sound, problems=problems)
    others = Others(plant, fusion, identifiers)
    instances = read_instances(system, filters, sensors, others, folder=path.parent, problems=problems)
    recorder, network = _read_recorder(root), read_network(root)
    supervisor = _read_supervisor(root)
    root.finish()
    names = [
        *((f"sensors.{name}", name) for name in sensors),
        *((f"filters.{name}", name) for name in filters),
        *((f"fusion.{name}", name) for name in fusion),
        *((f"identifier.{name}", name) for name in identifiers),
        *([("plant", plant.name)] if plant else []),
        ("recorder", "recorder"),
    ]
    _check_names(names, problems)
    check_reserved(network, names, problems)
    mesh = settle_start(mesh, root, plant, sensors=sensors)
    check_external_plant(plant, sensors, system, problems)
    states = None if model is None else model.states
    check_ros2(network, sensors, [*filters, *fusion], states, problems=problems)
    files = [*(sensor.file for sensor in sensors.values()), None if plant is None else plant.file]
    if any(file is not None and file.indexed_by == "time" for file in files) and not (
        mesh.start_ns is not None or mesh.starts_now
    ):
        text = "is missing; files with a time column need it: step k is at start_time + k dt"
        problems.add("mesh", "start_time", text, expected=START_TIME.words)
    if model is None or prior is None:
        if not problems.records:
            problems.add("model", "", "no model could be made", expected="A, rho and [model.prior]")
        return None
    return Configuration(
        path=path,
        mesh=mesh,
        base_model=model,
        prior=prior,
        input_box=input_box,
        plant=plant,
        sensors=dict(sorted(sensors.items())),
        filters=dict(sorted(filters.items())),
        fusion=dict(sorted(fusion.items())),
        recorder=recorder,
        network=network,
        supervisor=supervisor,
        warnings=tuple(
            map(
                problems.placed,
                (
                    *shared_sensor_warnings(problems.file, filters, fusion),
                    *open_endpoint_warnings(problems.file, network),
                    *ros2_warnings(problems.file, network, sensors),
                    *live_source_warnings(
                        problems.file,
                        sensors,
                        is_continuous=system.is_continuous,
                        has_unknown_inputs=plant is None
                        and model is not None
                        and model.input_count > 0
                        and input_box is None,
                    ),
                ),
            )
        ),
        identifiers=dict(sorted(identifiers.items())),
        continuous=system.continuous,
        schedule=system.schedule,
        input_delay_ns=input_delay_ns(mesh, plant, system.input_delay_ns),
        instances=instances,
    )


def _named(root: Table, key: str, problems: Problems) -> dict[str, Table]:
    outer = root.table(key)
    if outer is None:
        return {}
    named = {}
    for name, values in outer.values.items():
        if is_name(name):
            named[name] = Table(values, f"{key}.{name}", problems)
        else:
            text = f'"{name}" is no name; expected {NAME_RULE}'
            problems.add(f"{key}.{name}", "", text, expected=NAME_RULE, found=shown(name))
    return named


def _read_recorder(root: Table) -> RecorderSettings:
    table = root.table("recorder")
    if table is None:
        return RecorderSettings()
    path = table.text("path", RecorderSettings.path)
    flush = table.duration("flush", RecorderSettings.flush, low=0.01)
    mesh_hz = table.number("mesh_hz", RecorderSettings.mesh_hz, above=0.0)
    axes = tuple(table.texts("axes", []))
    draw_hz = table.number("draw_hz", RecorderSettings.draw_hz, above=0.0)
    part_size = table.size("part_size", RecorderSettings.part_size)
    part_time = table.duration("part_time", RecorderSettings.part_time)
    predictions = table.flag("predictions", RecorderSettings.predictions)
    table.finish()
    return RecorderSettings(
        path, flush, mesh_hz, axes, draw_hz=draw_hz, part_size=part_size, part_time=part_time, predictions=predictions
    )


def _read_supervisor(root: Table) -> SupervisorSettings:
    table = root.table("supervisor")
    if table is None:
        return SupervisorSettings()
    restart = table.flag("restart", SupervisorSettings.restart)
    backoff = table.duration("backoff", SupervisorSettings.backoff)
    limit = table.whole("limit", SupervisorSettings.limit)
    table.finish()
    return SupervisorSettings(restart, backoff, limit)


def _check_names(names: Sequence[tuple[str, str]], problems: Problems) -> None:
    first: dict[str, str] = {}
    for table, name in names:
        if name in first:
            text = f'two peers are called "{name}", here and in [{first[name]}]; give each a name of its own'
            problems.add(table, "", text, expected="a name that no other peer of the mesh has", found=shown(name))
        first.setdefault(name, table)
