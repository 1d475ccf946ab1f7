"""``lsu-mesh new``: what it writes is valid, plays every row, and never costs a file that is there."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from lsu_mesh_services.cli import main

from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.config.measurement_files import accounts
from lsu_mesh.mesh.data_files import read

ROWS = 40
SECONDS = [f"{1600120070 + k / 5:.1f}" for k in range(ROWS)]
ISO = [f"2020-09-14T21:47:{50 + k / 5:.1f}+00:00" if k < 50 else "" for k in range(ROWS)]
HEIGHTS = [f"{100 + k * k / 8:.2f}" for k in range(ROWS)]


def data(tmp_path: Path, header: str, *columns: list[str]) -> Path:
    path = tmp_path / "Flight 7.csv"
    path.write_text(header + "\n" + "".join(",".join(row) + "\n" for row in zip(*columns, strict=True)))
    return path


def new(tmp_path: Path, *arguments: str) -> Path:
    assert main(["new", str(tmp_path / "mesh.toml"), *arguments]) == 0
    return tmp_path / "mesh.toml"


@pytest.mark.parametrize("source", [[], ["--from", "demo"]])
def test_the_demo_is_written_with_comments(tmp_path: Path, root: Path, source: list[str]) -> None:
    demo = root / "services" / "lsu_mesh_services" / "demo.toml"
    written = new(tmp_path, *source)
    assert tomllib.loads(written.read_text()) == tomllib.loads(demo.read_text())
    assert written.read_text().count("\n# ") >= 15
    assert main(["validate", str(written)]) == 0


@pytest.mark.parametrize(
    ("header", "index", "start"),
    [
        ("time,height", SECONDS, 1600120069.8),
        ("Timestamp,height", [f"{text.replace('.', '')}00" for text in SECONDS], 1600120069.8),
        ("t,height", [f"{k / 5:.1f}" for k in range(1, ROWS + 1)], 0.0),
        ("step,height", [str(k) for k in range(1, ROWS + 1)], None),
    ],
)
def test_a_mesh_of_a_file_plays_every_row(tmp_path: Path, header: str, index: list[str], start: float | None) -> None:
    written = new(tmp_path, "--from", "file", str(data(tmp_path, header, index, HEIGHTS)))
    configuration = load(written)
    account = accounts(configuration)["sensors.data"]
    assert (account.delivered, account.left_out, account.first_step, account.largest_distance_ns) == (ROWS, 0, 1, 0)
    assert configuration.mesh.start_time == start
    assert configuration.mesh.name == "flight-7"
    assert configuration.mesh.dt == (1.0 if start is None else 0.2)
    assert main(["validate", str(written)]) == 0


def test_bounds_come_from_the_data(tmp_path: Path) -> None:
    written = new(tmp_path, "--from", "file", str(data(tmp_path, "time,height,who", SECONDS, HEIGHTS, ["Ada"] * ROWS)))
    configuration = load(written)
    sensor = configuration.sensors["data"]
    hundredths = [round(100 * float(height)) for height in HEIGHTS]
    steps = range(1, max(hundredths) - min(hundredths) + 1)
    largest = max(q for q in steps if all((one - hundredths[0]) % q == 0 for one in hundredths))
    assert sensor.r == (largest / 100 / 2,)
    assert sensor.outputs == ("height",)
    assert "# not used, because they hold no numbers: who" in written.read_text()
    assert configuration.continuous is not None
    np.testing.assert_array_equal(configuration.continuous.rates.A, [[0, 1], [0, 0]])
    np.testing.assert_allclose(configuration.base_model.A, [[1, 0.2], [0, 1]])
    seen = np.abs(np.diff(np.array(HEIGHTS, dtype=float), 2)).max() / 0.04
    assert configuration.continuous.rates.rho[0] == pytest.approx(1.5 * seen, rel=0.01)


def test_iso_times_tabs_and_odd_names_are_taken(tmp_path: Path) -> None:
    path = tmp_path / "log.tsv"
    path.write_text('date\tT (°C)\tx"y\n2024-05-01T12:00:00Z\t20.5\t1\n2024-05-01T12:00:30Z\t\t2\n')
    configuration = load(new(tmp_path, "--from", "file", str(path)))
    assert configuration.sensors["data"].outputs == ("T (°C)", 'x"y')
    assert configuration.mesh.dt == 30.0


def test_numpy_files_are_taken(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", time=np.arange(5) / 4 + 7, y=np.arange(10.0).reshape(5, 2))
    configuration = load(new(tmp_path, "--from", "file", str(tmp_path / "run.npz"), "--columns", "y.2"))
    assert configuration.sensors["data"].outputs == ("y.2",)
    assert accounts(configuration)["sensors.data"].delivered == 5


def irregular() -> tuple[list[str], list[str]]:
    """A drive that is reported every .3 to 2 s, to the nearest decimetre, with stamps of nanoseconds."""
    rng = np.random.default_rng(7)
    seconds = np.cumsum(rng.uniform(0.3, 2.0, ROWS))
    stamps = [1714564800_123456789 + round(second * 1e9) for second in seconds]
    return [f"{ns // 10**9}.{ns % 10**9:09d}" for ns in stamps], [f"{20 * np.sin(s / 9):.1f}" for s in seconds]


def played_through(configuration: Configuration) -> int:
    """Rows that a filter takes, each at its moment, without a contradiction."""
    sensor = configuration.sensors["data"]
    assert sensor.file is not None
    data = read(sensor.file)
    assert data.time_ns is not None
    flow, model = configuration.continuous, configuration.model(["data"])
    one = LSUO(model, configuration.prior)
    moment = configuration.grid.time_of(1)
    for time_ns, y in zip(data.time_ns.tolist(), data.values, strict=True):
        assert flow is not None
        if time_ns > moment:
            one.predict(model=flow.discretised(time_ns - moment))
        one.update(y)
        moment = time_ns
    return data.row_count


@pytest.mark.parametrize("is_regular", [True, False])
def test_a_filter_finds_no_contradiction_in_what_it_was_made_from(tmp_path: Path, is_regular: bool) -> None:
    columns = (SECONDS, HEIGHTS) if is_regular else irregular()
    written = new(tmp_path, "--from", "file", str(data(tmp_path, "time,height", *columns)))
    assert played_through(load(written)) == ROWS


def test_an_irregular_file_is_played_whole_and_from_its_first_nanosecond(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    times, heights = irregular()
    written = new(tmp_path, "--from", "file", str(data(tmp_path, "time,height", times, heights)))
    configuration = load(written)
    account = accounts(configuration)["sensors.data"]
    assert (account.delivered, account.left_out, account.first_step) == (ROWS, 0, 1)
    assert configuration.grid.time_of(1) == int(times[0].replace(".", ""))
    capsys.readouterr()
    assert main(["validate", str(written)]) == 0
    told = capsys.readouterr().err
    assert "warning" not in told
    assert "[model] noise of one dt (1.1 s), in state units: height " in told


def test_a_file_that_is_there_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mesh.toml").write_text("mine")
    assert main(["new", str(tmp_path / "mesh.toml")]) == 2
    assert (tmp_path / "mesh.toml").read_text() == "mine"
    assert "is there already; --force writes over it" in capsys.readouterr().err
    new(tmp_path, "--force")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n", "no column is called time or step (a, b); name it: --time COLUMN"),
        ("1,2\n2,3\n", "no line looks like a header"),
        ("t,y\n1,high\n2,low\n", "line 2, column 'y': expected a number or nothing (= missing), found 'high'"),
    ],
)
def test_what_cannot_be_a_start_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    (tmp_path / "data.csv").write_text(text)
    assert main(["new", str(tmp_path / "mesh.toml"), "--from", "file", str(tmp_path / "data.csv")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "mesh.toml").exists()


@pytest.mark.parametrize("source", [["file"], ["demo", "x"], ["nothing"]])
def test_other_sources_are_refused(tmp_path: Path, source: list[str]) -> None:
    assert main(["new", str(tmp_path / "mesh.toml"), "--from", *source]) == 2
    assert not (tmp_path / "mesh.toml").exists()
