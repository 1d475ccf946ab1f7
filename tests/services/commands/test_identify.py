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


CONTINUOUS = """
[mesh]
name = "files"
dt = {dt}
start_time = 0.0
[model]
continuous = true
A = [[0.0]]
rho = [0.5]
{model}
[model.prior]
lower = [-50.0]
upper = [50.0]
[model.domain]
lower = [-50.0]
upper = [50.0]
[sensors.s]
C = [[1.0]]
r = [0.2]
file = "s.csv"
columns = ["y"]
time = "t"
"""


def drift(tmp_path: Path, dt: str = "0.5", model: str = "") -> Path:
    """``x' = w`` with reports at 0, 1 and 5 half seconds: 3 in half a second, and 4 in 2 s."""
    (tmp_path / "s.csv").write_text("t,y\n0.5,0.0\n1.0,3.0\n3.0,7.0\n")
    path = tmp_path / "mesh.toml"
    path.write_text(CONTINUOUS.format(dt=dt, model=model))
    return path


def test_of_a_continuous_model_the_rate_is_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["identify", str(drift(tmp_path)), "--learn", "rho", "--margin", "1", "--share", "1"]
    assert main([*arguments, "--json"]) == OK
    found = json.loads(capsys.readouterr().out)
    assert found["rho"] == [pytest.approx((3.0 - 0.4) / 0.5)]
    assert found["factor"] == pytest.approx(found["rho"][0] / 0.5)
    assert main(arguments) == OK
    assert "rho is a rate: a bound of the noise at every moment" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("dt", "model", "options", "said"),
    [
        ("0.5", "", ["--unknown", "A,1,1,-1,1"], "--unknown needs a discrete model"),
        ("0.5", "", ["--learn", "separate"], 'take "both", "r" or "rho"'),
        ('"1/6"', "", [], "choose a dt of whole nanoseconds"),
        ("0.5", "schedule = [{ from = 3, rho = [1.0] }]", [], "names several: remove it"),
    ],
)
def test_what_a_continuous_model_cannot_have_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], dt: str, model: str, options: list[str], said: str
) -> None:
    assert main(["identify", str(drift(tmp_path, dt, model)), "--share", "1", *options]) != OK
    assert said in capsys.readouterr().err
