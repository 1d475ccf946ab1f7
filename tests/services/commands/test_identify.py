"""The command that finds bounds in files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import NOT_MET, OK, USAGE

from lsu_mesh import simulate, systems

CONFIGURATION = """
[mesh]
name = "files"
dt = 1.0
[model]
A = [[0.8144, -0.0905], [0.0905, 0.9953]]
rho = [0.1, 0.1]
[model.prior]
lower = [-5.0, -5.0]
upper = [5.0, 5.0]
[model.domain]
lower = [-50.0, -50.0]
upper = [50.0, 50.0]
[sensors.s]
C = [[0.0, 1.0]]
r = [0.05]
file = "s.csv"
columns = ["y"]
step = "step"
"""


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    """S3 without inputs, its sensor's r declared at half the truth, 300 steps of it in a file."""
    data = simulate(systems.get("S3"), 300, 1, inputs="zero")
    rows = "\n".join(f"{k + 1},{y[0]!r}" for k, y in enumerate(data.Y.tolist()))
    (tmp_path / "s.csv").write_text(f"step,y\n{rows}\n")
    path = tmp_path / "mesh.toml"
    path.write_text(CONFIGURATION)
    return path


def test_it_prints_bounds_that_explain_both_halves(mesh: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["identify", str(mesh), "--learn", "r", "--json"]) == OK
    found = json.loads(capsys.readouterr().out)
    assert 1.0 < found["factor"] <= 2.0
    assert found["r"] == [pytest.approx(1.2 * found["factor"] * 0.05)]
    assert found["rho"] == [0.1, 0.1]
    assert found["held_out"]["rows"] == [151, 300]
    assert found["held_out"]["explained"]


def test_it_says_what_breaks_them(mesh: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = mesh.parent / "s.csv"
    lines = file.read_text().splitlines()
    lines[250] = "250,40.0"
    file.write_text("\n".join(lines) + "\n")
    assert main(["identify", str(mesh), "--learn", "r"]) == NOT_MET
    assert "step 250: s = 40 breaks them" in capsys.readouterr().out


def test_a_wrong_sensor_and_missing_data_are_said(
    mesh: Path, demo: Path, capsys: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    assert main(["identify", str(mesh), "--sensors", "t"]) == USAGE
    assert "there is no sensor 't'" in capsys.readouterr().err
    assert main(["identify", str(demo)]) == USAGE
    assert "no sensor has data" in capsys.readouterr().err


def test_data_between_the_steps_are_refused_by_name(mesh: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = mesh.read_text().replace('step = "step"', 'time = "t"').replace("dt = 1.0", "dt = 1.0\nstart_time = 0.0")
    mesh.write_text(text)
    (mesh.parent / "s.csv").write_text("t,y\n1.0,0.5\n2.0,0.5\n3.25,0.5\n")
    assert main(["identify", str(mesh)]) == USAGE
    said = capsys.readouterr().err
    assert "off the grid" in said or "a measurement of s lies up to 750 ms from step 4" in said
    (mesh.parent / "s.csv").write_text("t,y\n1.0,0.5\n2.0,0.5\n2.0,0.75\n")
    assert main(["identify", str(mesh)]) == USAGE
    assert "a measurement of s is not the only one of step 2" in capsys.readouterr().err
