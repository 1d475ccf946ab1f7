"""What a mesh plays from files: by step, read once, and counted."""

from __future__ import annotations

from pathlib import Path

import pytest

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.config.measurement_files import FileProblems, accounts
from lsu_mesh.mesh.nodes.played_rows import PlayedRows


@pytest.fixture
def demo(root: Path) -> str:
    return (root / "services" / "lsu_mesh_services" / "demo.toml").read_text()


def playing(tmp_path: Path, demo: str, csv: str, keys: str = "") -> Configuration:
    (tmp_path / "s1.csv").write_text(csv)
    text = demo.replace("C = [[1.0, 0.0, 0.5]]", f'C = [[1.0, 0.0, 0.5]]\nfile = "s1.csv"\n{keys}', 1)
    (tmp_path / "mesh.toml").write_text(text)
    return load(tmp_path / "mesh.toml")


def test_loading_reads_the_header_and_nothing_else(tmp_path: Path, demo: str) -> None:
    configuration = playing(tmp_path, demo, "step,y\n" + "1,0.5\n" * 100_000 + "2,high\n")
    file = configuration.sensors["s1"].file
    assert file is not None
    assert file.columns == ("y",)
    with pytest.raises(FileProblems, match="line 100002, column 'y'"):
        accounts(configuration)


def test_mistakes_of_rows_come_together(tmp_path: Path, demo: str) -> None:
    configuration = playing(tmp_path, demo, "step,y\n1,0.5\n2,high\n3,inf\n2.5,1\n")
    with pytest.raises(FileProblems) as caught:
        accounts(configuration)
    step, text, infinite = (line.removeprefix(f"{tmp_path}/") for line in caught.value.lines)
    assert step == "s1.csv: line 5, column 'step': expected a whole number, found '2.5'"
    assert text.startswith("s1.csv: line 3, column 'y': expected a number or nothing (= missing), found 'high'; if it")
    assert infinite.startswith(
        "s1.csv: line 4, column 'y': expected a number or nothing (= missing), found 'inf'; leave"
    )


def test_a_file_of_which_nothing_plays_is_a_mistake(tmp_path: Path, demo: str) -> None:
    configuration = playing(tmp_path, demo, "step,y\n0,0.5\n", "")
    with pytest.raises(FileProblems, match="no row is played: its steps are 0 to 0"):
        accounts(configuration)


def test_what_is_played_is_what_is_counted(tmp_path: Path, demo: str) -> None:
    text = demo.replace("dt = 0.02", "dt = 0.02\nstart_time = 0.0")
    keys = 'time = "t"\ngrid_tolerance = "1ms"'
    configuration = playing(tmp_path, text, "t,y\n0.02,1\n0.041,2\n0.039,3\n-1,4\n0.1,\n", keys)
    found, played = accounts(configuration)["sensors.s1"], PlayedRows(configuration, "s1")
    by_step = {k: [float(row.y[0]) for row in played.of(k)] for k in range(played.first, played.last + 1)}
    assert (found.rows, found.delivered, found.before, found.sharing) == (5, 4, 1, 1)
    assert (found.off_grid, found.by_tolerance) == (0, 2)
    assert {k: len(values) for k, values in by_step.items() if values} == {1: 1, 2: 2, 5: 1}
    assert by_step[2] == [3.0, 2.0]
    assert (played.before, played.after, found.steps_used) == (1, 0, 3)
