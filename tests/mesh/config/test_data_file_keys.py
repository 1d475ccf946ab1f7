"""The keys that say how a file is written reach the reader."""

from __future__ import annotations

from pathlib import Path

import pytest

from lsu_mesh.mesh.config import Configuration, ConfigurationError, load
from lsu_mesh.mesh.config.measurement_files import accounts, read_playback


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
    file, mesh = configuration.sensors["s1"].file, configuration.mesh
    assert file is not None
    played = read_playback(file, mesh.dt, mesh.start_time)
    assert played.steps.tolist() == [1, 2]
    assert played.values[0].tolist() == [2.5]
    assert accounts(configuration)["sensors.s1"].missing_values == 1


@pytest.mark.parametrize("value", ['"ab"', '"\\""', '"\\n"', '"é"'])
def test_a_delimiter_is_one_character(tmp_path: Path, root: Path, value: str) -> None:
    with pytest.raises(ConfigurationError, match=r"\[sensors\.s1\] delimiter: expected one character"):
        playing(tmp_path, root, "step,y\n1,2\n", f'file = "s1.csv"\ndelimiter = {value}')


def test_keys_of_a_file_need_a_file(tmp_path: Path, root: Path) -> None:
    with pytest.raises(ConfigurationError) as caught:
        playing(tmp_path, root, "", 'decimal = ","\nmissing = ["?"]')
    assert [line.partition(": ")[2].partition(" without")[0] for line in caught.value.problems] == [
        "[sensors.s1] decimal: has no effect",
        "[sensors.s1] missing: has no effect",
    ]
