"""Files of mistakes at the command line: a line that helps, exit code 2, nothing started and no traceback."""

from __future__ import annotations

import json
import math
import os
import re
from pathlib import Path

import pytest
from lsu_mesh_services.cli import main

MESH = """
[mesh]
name = "filed"
dt = 0.5
start_time = {start}
[model]
A = [[1.0]]
rho = [0.1]
[model.prior]
lower = [-10.0]
upper = [10.0]
[sensors.gauge]
C = [[1.0]]
r = [0.5]
file = "gauge.csv"
time = "t"
[filters.box]
kind = "LSUO"
sensors = ["gauge"]
"""


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    (tmp_path / "mesh.toml").write_text(MESH.format(start=100.0))
    return tmp_path / "mesh.toml"


@pytest.mark.parametrize("command", ["validate", "run", "identify"])
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,y\n100.5,1,5\n", "line 2: 3 cells, the header has 2; a decimal comma"),
        ("t,y\n100.5,1\n101,2,\n", "line 3: the row ends with a ','"),
        ("t,y,y\n100.5,1,2\n", "line 1: columns 2 and 3 are both called 'y'"),
        ("t,y\n100.5,1_0\n", "line 2, column 'y': expected a number or nothing (= missing), found '1_0'"),
        ("t,y\n100.5,1\n101", "line 3: the last line is cut off"),
        ("t,y\n99,1\n100,1\n", "no row is played: start_time = 100 s is after all rows"),
        ("t,y\n1600120070123,1\n", "no row is played: its times count from 1970, start_time does not; the first row"),
        ("t,y\n1600120070123456789,1\n", "no row is played: its times count from 1970, start_time does not"),
        ("t,y\n1e300,1\n", "column 't': times from 1e+300 to 1e+300 fit no unit"),
        (b"t,y\n100.5,1\n\0", "line 3: holds a zero byte"),
        ("", "is empty"),
    ],
)
def test_a_mistake_is_told_before_anything_starts(
    mesh: Path, capsys: pytest.CaptureFixture[str], command: str, text: str | bytes, words: str
) -> None:
    (mesh.parent / "gauge.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    assert main([command, str(mesh)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith(f"{mesh.parent / 'gauge.csv'}: {words}")
    assert lines[1:] == ["1 mistake; nothing was started"]


@pytest.mark.parametrize("command", ["validate", "run", "identify"])
def test_a_pipe_in_the_place_of_a_file_is_not_waited_for(
    mesh: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    os.mkfifo(mesh.parent / "gauge.csv")
    assert main([command, str(mesh)]) == 2
    assert "gauge.csv: is a pipe (FIFO); expected a file of CSV" in capsys.readouterr().err


def test_validate_prints_the_account_and_warns_of_what_is_left_out(
    mesh: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (mesh.parent / "gauge.csv").write_text("t,y\n99,1\n100.5,2\n100.6,3\n101,\n")
    continuous = ["-X", "model.continuous=true"]
    assert main(["validate", str(mesh), *continuous]) == 0
    told = capsys.readouterr().err
    assert "gauge.csv: 4 rows, 99 s to 101 s (2 s); period 400 ms (from 100 ms to 1.5 s)" in told
    assert "  played: 3 rows on 2 steps, 1 to 2, 0 of them without a row; 1 value missing" in told
    assert "  farthest from the grid: 100 ms; 1 row off the grid" in told
    assert "gauge.csv: warning: 1 of 4 rows are left out: 1 before start_time" in told
    noise = re.search(
        r"\[model\] noise of one dt \(500 ms\), in state units: x1 (.*); rho is a rate, per second: 0\.1", told
    )
    assert noise is not None
    assert main(["validate", str(mesh), "--json", *continuous]) == 0
    record = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert record["files"]["sensors.gauge"]["before"] == 1
    assert main(["validate", str(mesh), "--json", *continuous]) == 0
    warning = json.loads(capsys.readouterr().out.splitlines()[0])
    assert (warning["level"], warning["file"], warning["table"], warning["key"], warning["text"]) == (
        "warning", str(mesh.parent / "gauge.csv"), "sensors.gauge", "file",
        "1 of 4 rows are left out: 1 before start_time",
    )  # fmt: skip
    assert warning.keys() == {
        "level", "file", "table", "key", "found", "expected", "nearest", "line", "text", "source",
    }  # fmt: skip
    (numbers,) = record["noise_of_one_dt"]
    assert (numbers["from"], numbers["rho"], f"{numbers['states']['x1']:.4g}") == (1, [0.1], noise[1])
    exact = 0.1 * math.expm1(0.5)
    assert exact <= numbers["states"]["x1"] <= 1.02 * exact, "of dx/dt = x + w"


OFF_GRID = (
    "2 of 3 rows lie off the grid, by up to 200 ms, and a discrete model knows nothing between steps; set [model] "
    'continuous = true, or [sensors.gauge] rate = [the bound of |dy/dt|], or [sensors.gauge] off_grid = "nearest" '
    "(no set is guaranteed then)"
)


@pytest.mark.parametrize("command", ["validate", "run"])
def test_a_discrete_model_refuses_rows_between_steps(
    mesh: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    data = mesh.parent / "gauge.csv"
    data.write_text("t,y\n100.5,1\n100.6,1\n101.3,1\n")
    assert main([command, str(mesh)]) == 2
    assert capsys.readouterr().err.splitlines() == [f"{data}: {OFF_GRID}", "1 mistake; nothing was started"]


def test_a_mistake_of_a_file_has_all_fields_in_json(mesh: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = mesh.parent / "gauge.csv"
    data.write_text("t,y\n100.5,1\n101,high\n")
    assert main(["validate", str(mesh), "--json"]) == 2
    (record,) = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert record.pop("text").startswith("line 3, column 'y': expected a number or nothing (= missing), found 'high'")
    assert record == {
        "level": "mistake", "file": str(data), "table": "sensors.gauge", "key": "file", "found": "'high'",
        "expected": "a number or nothing (= missing)", "nearest": None, "line": 3, "source": None,
    }  # fmt: skip


def test_rows_between_steps_are_used_where_the_sensor_says_how(mesh: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (mesh.parent / "gauge.csv").write_text("t,y\n100.5,1\n100.6,1\n101.3,1\n")
    assert main(["validate", str(mesh), "-X", "sensors.gauge.rate=[2.0]"]) == 0
    told = capsys.readouterr().err
    assert "warning" not in told
    assert "  played: 3 rows on 3 steps, 1 to 3" in told, "a row is of the step that it comes before"
    assert main(["validate", str(mesh), "-X", "sensors.gauge.off_grid=nearest"]) == 0
    told = capsys.readouterr().err
    assert (
        '2 rows lie off the grid, by up to 200 ms, and off_grid = "nearest": every set will say guarantee = "none"'
        in told
    )
    assert "  played: 3 rows on 2 steps, 1 to 3" in told, "a row is of the nearest step, and none is left out"


def test_rows_within_the_tolerance_are_of_the_step_and_counted(mesh: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (mesh.parent / "gauge.csv").write_text("t,y\n100.49,1\n101.02,1\n101.5,1\n")
    assert main(["validate", str(mesh), "-X", 'sensors.gauge.grid_tolerance="20ms"']) == 0
    told = capsys.readouterr().err
    assert "  played: 3 rows on 3 steps, 1 to 3" in told
    assert "  on the grid within the tolerance, and not exactly: 2 rows" in told
    assert main(["validate", str(mesh), "-X", 'sensors.gauge.grid_tolerance="19ms"']) == 2
    assert "1 of 3 rows lies off the grid, by up to 20 ms" in capsys.readouterr().err
