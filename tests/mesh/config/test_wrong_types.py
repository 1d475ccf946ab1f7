"""Every key of the schema with values of every type: taken as what it means, or a mistake with all its fields."""

from __future__ import annotations

import copy
import datetime
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from lsu_mesh.mesh.config import ConfigurationError, Problem, load_values, load_with_keys

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "examples" / "mesh.toml"
VALUES: dict[str, Any] = {
    "text": "some text", "empty text": "", "number in quotes": "7", "true": True, "false": False, "whole": 7,
    "whole float": 20.0, "float": 2.5, "zero": 0, "negative": -3, "negative float": -2.5, "nan": math.nan,
    "inf": math.inf, "huge": 10**400, "list": [1, 2], "empty list": [], "texts": ["a", "b"], "mixed": [1, "a", True],
    "rows": [[1.0, 2.0], [3.0]], "table": {"a": 1}, "tables": [{"a": 1}], "date": datetime.date(2026, 1, 2),
}  # fmt: skip
TEXT, FLAG, WHOLE = {"text", "number in quotes"}, {"true", "false"}, {"whole"}
POSITIVE = {"whole", "whole float", "float"}
NUMBER = {*POSITIVE, "zero", "negative", "negative float"}
TAKEN: dict[str, set[str]] = {
    "mesh.name": {"number in quotes"}, "mesh.dt": {*POSITIVE, "number in quotes"}, "mesh.steps": WHOLE,
    "mesh.seed": {"whole", "zero"},
    "mesh.rate": POSITIVE, "mesh.start_time": {*NUMBER, "number in quotes", "date"},
    "model.rho": {*POSITIVE, "zero"}, "model.continuous": {"false"}, "model.input_delay": {"zero"},
    "model.schedule": {"empty list"}, "model.schedule[0].rho": {*POSITIVE, "zero"},
    "model.schedule[0].from": {*POSITIVE, "number in quotes", "date"},
    "sensors.*.time_error": {"zero"},
    "mesh.future": {*POSITIVE, "zero"}, "mesh.past": {*POSITIVE, "zero"},
    "sensors.*.jitter": {"zero"}, "sensors.*.clock_error": {"zero"},
    "sensors.*.every": POSITIVE, "sensors.*.grid_tolerance": {*POSITIVE, "zero"},
    "plant.name": {"number in quotes"},
    "plant.file": TEXT, "sensors.*.file": TEXT,
    "sensors.*.simulated_r": {"empty list"}, "sensors.*.faults": {"empty list"},
    "sensors.s1.faults[0].from": WHOLE, "sensors.s1.faults[0].size": NUMBER,
    "filters.*.history": WHOLE, "filters.*.transfer_from": {"empty list"}, "filters.*.reset_after": WHOLE,
    "filters.*.transfer.publish_when": {*POSITIVE, "zero"},
    "filters.*.box": FLAG, "filters.*.scaled": FLAG, "filters.*.reduce": FLAG,
    "filters.*.lag": {"whole", "zero"},
    "filters.*.meet": FLAG, "filters.*.max_generators": WHOLE, "filters.*.max_constraints": {"whole", "zero"},
    "filters.*.order": WHOLE, "filters.*.window": WHOLE, "filters.*.unknown": {"empty list"},
    "filters.*.rho_range": {"list"}, "filters.*.r_range": {"list"},
    "filters.*.kappa": POSITIVE, "filters.*.handover": POSITIVE, "filters.*.sigmas": POSITIVE,
    "filters.*.feedback": FLAG,
    "identifier.*.window": WHOLE, "identifier.*.every": WHOLE, "identifier.*.margin": POSITIVE,
    "identifier.*.lead": WHOLE,
    "fusion.*.faults": {"zero"}, "fusion.*.max_lag": {"whole", "zero"}, "fusion.*.quarantine_after": WHOLE,
    "fusion.*.max_generators": WHOLE, "fusion.*.max_constraints": {"whole", "zero"},
    "recorder.path": TEXT, "recorder.mesh_hz": POSITIVE, "recorder.draw_hz": POSITIVE,
    "recorder.axes": {"empty list", "texts"},
    "recorder.predictions": FLAG,
    "network.listen": {"empty list"}, "network.connect": {"empty list"}, "network.cache": WHOLE,
    "network.tls.enabled": FLAG, "network.tls.authority": TEXT, "network.tls.certificate": TEXT,
    "network.tls.key": TEXT, "network.tls.access_control": FLAG, "network.tls.verify_hosts": FLAG,
    "network.ros2.connect": {"empty list"}, "network.ros2.listen": {"empty list"},
    "network.ros2.domain_id": {"whole", "zero"}, "network.ros2.publish": {"empty list"},
    "network.ros2.publish[0].frame_id": TEXT, "network.ros2.publish[0].diagnostics": FLAG,
    "sensors.s1.faults[0].instances": {"empty list"},
    "supervisor.restart": FLAG, "supervisor.limit": {"whole", "zero"},
}  # fmt: skip
"""What each key takes of ``VALUES``; a key that is not here takes none of them."""
SAID_ELSEWHERE = {
    "model.prior.lower": "model.prior.upper", "model.domain.lower": "model.domain.upper",
    "model.input_box.lower": "model.input_box.upper", "model.continuous": "filters.window",
}  # fmt: skip
"""Limits of other lengths: the mistake is told at the second one; that a class refuses a model, at its filter."""
TABLES = (
    "mesh", "model", "model.prior", "model.domain", "model.input_box", "plant", "sensors", "sensors.s1", "filters",
    "filters.box", "fusion", "fusion.main", "identifier", "identifier.bounds", "recorder", "network", "network.tls",
    "network.ros2", "supervisor",
)  # fmt: skip


def keys() -> list[str]:
    """Paths of all keys that the schema knows."""
    return sorted(load_with_keys(EXAMPLE)[1])


def general(path: str) -> str:
    """A path without the name of the peer, unless the peer alone has the key."""
    return path if "[" in path else re.sub(r"^(sensors|filters|fusion|identifier)\.\w+", r"\1.*", path)


def with_value(path: str, value: object) -> dict[str, Any]:
    """The example with one key replaced."""
    values: dict[str, Any] = copy.deepcopy(tomllib.loads(EXAMPLE.read_text()))
    if path.startswith("model.schedule["):
        values["model"]["schedule"] = [{"from": 400, "rho": [0.1, 0.1, 0.1]}]
    if path.startswith("network.ros2.publish["):
        values["network"]["ros2"] = {"publish": [{"estimator": "box", "topic": "/box", "states": ["x1"]}]}
    *outer, last = re.findall(r"\w+", path)
    table: Any = values
    for part in outer:
        table = table[int(part)] if part.isdigit() else table.setdefault(part, {})
    table[last] = value
    if last == "file":  # neither goes with a file
        table.pop("inputs", None)
        table.pop("faults", None)
    return values


def mistakes(values: dict[str, Any]) -> tuple[Problem, ...]:
    try:
        load_values(values, EXAMPLE, reads_files=False)
    except ConfigurationError as error:
        return error.records
    return ()


def check_fields(records: tuple[Problem, ...], path: str) -> None:
    """Each mistake is at the key, or inside of it, and has all its fields."""
    for one in records:
        place = f"{one.table}.{one.key}".strip(".")
        expected = SAID_ELSEWHERE.get(path) if place == SAID_ELSEWHERE.get(path) else path
        assert place == expected or place.startswith((f"{path}.", f"{path}[")), str(one)
        assert one.expected, str(one)
        assert one.found is not None or place != path or "missing" in one.text, str(one)
        assert f"{place.rpartition('.')[2]}" in str(one)


@pytest.mark.parametrize("path", keys())
def test_each_value_is_taken_or_a_mistake_with_place_and_expectation(path: str) -> None:
    taken = set()
    for name, value in VALUES.items():
        records = mistakes(with_value(path, value))
        check_fields(records, path)
        taken |= set() if records else {name}
    assert taken == TAKEN.get(general(path), set())


@pytest.mark.parametrize("path", TABLES)
def test_what_is_no_table_is_said_where_one_belongs(path: str) -> None:
    for name, value in VALUES.items():
        if name == "table":
            continue
        records = mistakes(with_value(path, value))
        assert records, name
        first, outer, last = next(one for one in records if one.expected == "a table"), *path.rpartition(".")[::2]
        assert (first.table, first.key) == (outer, last)


def test_every_key_that_takes_something_exists() -> None:
    assert set(TAKEN) <= {general(path) for path in keys()}
