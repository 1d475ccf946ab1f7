"""The commented example holds every option of the schema, and nothing else."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from lsu_mesh.mesh.config import load, load_with_keys
from lsu_mesh.mesh.config.data_file_keys import KEYS
from lsu_mesh.mesh.config.ros2 import KEYS as ROS2_KEYS

OPTION = re.compile(r"^# (\w+ = .*)$", re.MULTILINE)
EXCLUSIVE = {"sensors.s3.step", "sensors.s3.time", "sensors.s3.file", "sensors.s3.columns", "plant.file",
             "plant.columns", "plant.step", "plant.time", "filters.window.E", "filters.box.instances",
             *(f"sensors.s1.{key}" for key in ROS2_KEYS),
             *(f"{table}.{key}" for table in ("sensors.s3", "plant") for key in KEYS)}  # fmt: skip
"""Options that stand beside another one in the example, so that both cannot be on."""


@pytest.fixture(scope="module")
def example(root: Path) -> Path:
    return root / "examples" / "mesh.toml"


def paths(values: dict[str, Any], prefix: str = "") -> set[str]:
    """Paths of all keys, those of lists of tables with an index."""
    found = set()
    for key, value in values.items():
        path = f"{prefix}{key}"
        found.add(path)
        if isinstance(value, dict):
            found |= paths(value, f"{path}.")
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            found |= paths(value[0], f"{path}[0].")
    return found


def general(path: str) -> str:
    """A path without the name of the peer: ``filters.*.deadline``."""
    return re.sub(r"^(sensors|filters|fusion|identifier)\.\w+", r"\1.*", path)


def test_the_example_is_valid_as_it_stands(example: Path) -> None:
    configuration = load(example)
    assert set(configuration.filters) == {"box", "para", "cz", "zonotope", "window", "kalman"}


def test_every_option_of_the_schema_is_in_the_example_and_none_besides(example: Path) -> None:
    uncommented = OPTION.sub(r"\1", example.read_text())
    shown = {general(path) for path in paths(tomllib.loads(uncommented))}
    _, asked = load_with_keys(example)
    known = {general(path) for path in asked}
    assert known - shown == set()
    tables = {
        general(path) for path in shown if path in ("mesh", "model", "plant", "recorder", "network", "supervisor")
    }
    groups = {
        "sensors",
        "filters",
        "fusion",
        "sensors.*",
        "filters.*",
        "fusion.*",
        "identifier",
        "identifier.*",
        "model.prior",
        "model.domain",
    }
    assert shown - known - tables - groups - {"model.input_box", "network.tls", "network.ros2"} == set()


def test_the_commented_values_are_valid(example: Path, tmp_path: Path) -> None:
    (tmp_path / "s3.csv").write_text("step,y\n1,0.5\n")
    lines, table = [], ""
    for line in example.read_text().splitlines():
        header = re.match(r"^\[([\w.]+)\]", line)
        table = header[1] if header else table
        option = OPTION.match(line)
        key = option[1].split(" ")[0] if option else ""
        lines.append(option[1] if option and f"{table}.{key}" not in EXCLUSIVE else line)
    variant = tmp_path / "variant.toml"
    variant.write_text("\n".join(lines))
    assert load(variant).mesh.name == "example"


def test_the_commented_values_are_the_defaults(example: Path, tmp_path: Path) -> None:
    plain = load(example)
    lines = []
    for line in example.read_text().splitlines():
        option = OPTION.match(line)
        skipped = (
            "start_time",
            "file",
            "columns",
            "step ",
            "time ",
            "cache",
            "source",
            "transfer_from",
            "noise_map",
            "adopt",
            "publish",
            "instances",
            *ROS2_KEYS,
            *KEYS,
        )
        lines.append(option[1] if option and not option[1].startswith(skipped) else line)
    variant = tmp_path / "variant.toml"
    variant.write_text("\n".join(lines))
    full = load(variant)
    assert full.mesh == plain.mesh
    assert full.fusion == plain.fusion
    assert full.recorder == plain.recorder
    assert full.network == plain.network
    assert full.supervisor == plain.supervisor
    for name, settings in full.filters.items():
        own = plain.filters[name]
        assert {**vars(settings), "options": None} == {**vars(own), "options": None}
