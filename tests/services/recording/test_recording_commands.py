"""``lsu-mesh recording info|repair|merge|export``."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from local_mesh import LocalMesh
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import FAILURE, OK, USAGE
from lsu_mesh_services.recording.part_files import next_part
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.synthetic_mesh import SyntheticMesh, written
from recorded_mesh import record

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import Measurement, Smoothed


@pytest.fixture(scope="module")
def mesh(demo: Path) -> LocalMesh:
    """The demo after 40 steps, one measurement of which is missing."""
    mesh = LocalMesh(load(demo, ["mesh.steps=40", 'sensors.s2.faults=[{kind="lost", from=7, to=7}]']))
    mesh.run(1.0)
    return mesh


@pytest.fixture(scope="module")
def recording(mesh: LocalMesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its recording."""
    return record(mesh, tmp_path_factory.mktemp("recorded") / "demo.rrd")


@pytest.fixture
def in_two_parts(tmp_path: Path) -> list[Path]:
    """The parts of a recorder that was started again; the first is cut short."""
    configuration = written(tmp_path, 2, 2)
    mesh, made = SyntheticMesh(configuration), []
    for number in (1, 2):
        made.append(next_part(tmp_path / "run.rrd"))
        recorder = Recorder(configuration, made[-1], continues=made[0] if number > 1 else None)
        for arrival in mesh.run(20):
            recorder.record(*arrival)
            recorder.tick(arrival.arrival_ns)
        recorder.close()
    whole = made[0].read_bytes()
    made[0].write_bytes(whole[: int(0.9 * len(whole))])
    return made


def test_info_sums_a_recording_up(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["recording", "info", str(recording), "--json"]) == OK
    found = json.loads(capsys.readouterr().out)
    assert (found["steps"], found["statuses"], found["refused"], found["damaged"]) == (41, {"ok": 160}, 0, 0)
    assert found["about"]["mesh"] == "demo"
    peers = {peer["key"]: peer for peer in found["peers"]}
    assert (peers["posterior/cz"]["messages"], peers["posterior/cz"]["last_step"]) == (40, 40)
    assert all(peer["gaps"] == 0 and peer["boots"] == 1 for peer in peers.values())
    assert main(["recording", "info", str(recording)]) == OK
    assert "posterior/cz" in capsys.readouterr().out


def test_repair_makes_a_file_that_opens(in_two_parts: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    cut = in_two_parts[0]
    assert main(["recording", "repair", str(cut)]) == OK
    mended = cut.with_name("run.repaired.rrd")
    assert read_raw(mended) == read_raw(cut) != []
    assert main(["recording", "repair", str(cut)]) == USAGE, "it overwrites nothing unasked"
    assert "--force" in capsys.readouterr().err
    assert main(["recording", "repair", str(cut), "-o", str(cut), "--force"]) == OK


def test_merge_joins_the_parts_that_lie_beside_a_file(in_two_parts: list[Path]) -> None:
    assert main(["recording", "merge", str(in_two_parts[0])]) == OK
    joined = in_two_parts[0].with_name("run.merged.rrd")
    assert read_raw(joined) == read_raw(*in_two_parts)
    assert main(["recording", "merge", str(joined)]) == USAGE, "it has no parts"


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_export_gives_tables_with_every_bit(recording: Path, mesh: LocalMesh, tmp_path: Path, form: str) -> None:
    assert main(["recording", "export", str(recording), "--format", form, "-o", str(tmp_path / "out")]) == OK
    file = tmp_path / "out" / f"estimates.{form}"
    rows = list(csv.DictReader(file.read_text().splitlines())) if form == "csv" else pq.read_table(file).to_pylist()
    assert len(rows) == 160
    row = next(row for row in rows if (row["peer"], int(row["step"])) == ("cz", 20))
    sent, x = mesh.newest("cz")[20], mesh.truth()[20]
    assert [float(row[f"x{i}.lower"]) for i in (1, 2, 3)] == sent.lower
    assert [float(row[f"x{i}.upper"]) for i in (1, 2, 3)] == sent.upper
    assert float(row["x2.error"]) == sent.point[1] - x[1]


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_export_gives_smoothed_sets_where_there_are_some(demo: Path, tmp_path: Path, form: str) -> None:
    mesh = LocalMesh(load(demo, ["mesh.steps=20", "filters.cz.lag=4"]))
    mesh.run(0.6)
    recording = record(mesh, tmp_path / "demo.rrd")
    assert main(["recording", "export", str(recording), "--format", form]) == OK
    file = tmp_path / "demo" / f"smoothed.{form}"
    rows = list(csv.DictReader(file.read_text().splitlines())) if form == "csv" else pq.read_table(file).to_pylist()
    sent = [message for message in mesh.of(Smoothed, "cz") if isinstance(message, Smoothed)]
    assert [(row["peer"], int(row["step"]), int(row["lag"])) for row in rows] == [("cz", m.step, 4) for m in sent]
    for row, message in zip(rows, sent, strict=True):
        assert [float(row[f"x{i}.lower"]) for i in (1, 2, 3)] == message.lower
        assert [float(row[f"x{i}.upper"]) for i in (1, 2, 3)] == message.upper
        assert float(row["x1.truth"]) == mesh.truth()[message.step][0]


def test_export_of_a_mesh_that_smooths_nothing_has_no_such_table(recording: Path, tmp_path: Path) -> None:
    assert main(["recording", "export", str(recording), "-o", str(tmp_path / "out")]) == OK
    assert not (tmp_path / "out" / "smoothed.csv").exists()


def test_a_file_sensor_plays_what_was_exported(recording: Path, mesh: LocalMesh, tmp_path: Path) -> None:
    assert main(["recording", "export", str(recording), "-o", str(tmp_path / "out")]) == OK
    again = LocalMesh(load(tmp_path / "out" / "mesh.toml"))
    again.run(1.0)
    measured = {(m.name, m.step): m.y for m in mesh.of(Measurement) if isinstance(m, Measurement)}
    assert measured["s2", 7] == [None]
    assert {(m.name, m.step): m.y for m in again.of(Measurement) if isinstance(m, Measurement)} == measured
    assert again.truth() == {}, "real measurements have no truth, and none is made up"
    for name in mesh.estimators():
        assert {k: m.support for k, m in again.newest(name).items()} == {
            k: m.support for k, m in mesh.newest(name).items()
        }


def test_mistakes_are_said(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "something").write_text("mine")
    assert main(["recording", "export", str(recording), "-o", str(tmp_path / "full")]) == FAILURE
    assert "not empty" in capsys.readouterr().err
    (tmp_path / "text.rrd").write_text("no recording")
    for action in ("info", "repair"):
        assert main(["recording", action, str(tmp_path / "text.rrd")]) != OK
        assert "not a Rerun recording" in capsys.readouterr().err
        assert main(["recording", action, str(tmp_path / "nowhere.rrd")]) == USAGE
        assert "nowhere.rrd" in capsys.readouterr().err
