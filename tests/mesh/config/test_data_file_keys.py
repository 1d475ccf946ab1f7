"""The keys that say how a file is written reach the reader."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from lsu_mesh.mesh.config import Configuration, ConfigurationError, load, load_values
from lsu_mesh.mesh.config.measurement_files import accounts
from lsu_mesh.mesh.config.write import to_toml
from lsu_mesh.mesh.nodes.played_rows import PlayedRows


def playing(tmp_path: Path, root: Path, csv: str, keys: str) -> Configuration:
    (tmp_path / "s1.csv").write_text(csv)
    demo = (root / "services" / "lsu_mesh_services" / "demo.toml").read_text()
    text = demo.replace("C = [[1.0, 0.0, 0.5]]", f"C = [[1.0, 0.0, 0.5]]\n{keys}", 1)
    (tmp_path / "mesh.toml").write_text(text.replace("seed = 1", "seed = 1\nstart_time = 1600120070.0"))
    return load(tmp_path / "mesh.toml")


def test_a_file_is_read_as_its_keys_say(tmp_path: Path, root: Path) -> None:
    keys = (
        'file = "s1.csv"\ntime = "t"\ntime_unit = "ms"\ndelimiter = "|"\ndecimal = ","\ncomment = "%"\nmissing = ["?"]'
    )
    csv = "t|y\n% a pause\n1600120070020,0|2,5\n1600120070040|?\n"
    configuration = playing(tmp_path, root, csv, keys)
    played = PlayedRows(configuration, "s1")
    assert (played.first, played.last) == (1, 2)
    assert [row.y.tolist() for row in played.of(1)] == [[2.5]]
    assert accounts(configuration)["sensors.s1"].missing_values == 1


@pytest.mark.parametrize(
    "line", ['delimiter = "ab"', 'delimiter = "é"', 'decimal = ";"', 'time_unit = "min"', "missing = 9", "comment = 1"]
)
def test_other_values_are_refused(tmp_path: Path, root: Path, line: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"\[sensors\.s1\] {line.partition(' ')[0]}: "):
        playing(tmp_path, root, "step,y\n1,2\n", f'file = "s1.csv"\n{line}')


def test_keys_of_a_file_need_a_file(tmp_path: Path, root: Path) -> None:
    with pytest.raises(ConfigurationError) as caught:
        playing(tmp_path, root, "", 'decimal = ","\nmissing = ["?"]')
    decimal, missing = caught.value.problems
    assert "[sensors.s1] decimal: has no effect without file" in decimal
    assert "[sensors.s1] missing: has no effect without file" in missing


@pytest.mark.parametrize(
    "start",
    ["1600120070.0", "2020-09-14T21:47:50Z", "2020-09-14 21:47:50", '"2020-09-14T23:47:50+02:00"', "1600120070000"],
)
def test_a_start_time_is_a_number_a_date_or_a_text(tmp_path: Path, root: Path, start: str) -> None:
    configuration = playing(tmp_path, root, "step,y\n1,2\n", 'file = "s1.csv"')
    text = configuration.path.read_text().replace("start_time = 1600120070.0", f"start_time = {start}")
    configuration.path.write_text(text)
    loaded = load(configuration.path)
    assert loaded.mesh.start_time == 1600120070.0
    again = load_values(tomllib.loads(to_toml(loaded.values)), loaded.path)
    assert again.mesh == loaded.mesh, "a recording holds the values as text"


@pytest.mark.parametrize("start", ["true", '"yesterday"', "21:47:50", "1e300"])
def test_another_start_time_is_refused(tmp_path: Path, root: Path, start: str) -> None:
    configuration = playing(tmp_path, root, "step,y\n1,2\n", 'file = "s1.csv"')
    text = configuration.path.read_text().replace("start_time = 1600120070.0", f"start_time = {start}")
    configuration.path.write_text(text)
    with pytest.raises(ConfigurationError, match=r"\[mesh\] start_time: expected seconds, a moment"):
        load(configuration.path)
