"""Bags that rosbags wrote become files that sensors play: every time and value exact, every mistake named."""

from __future__ import annotations

import csv
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from lsu_mesh_services.cli import main
from ros_messages import STORE, laser_scan, made, nav_sat_fix, payload
from rosbags.rosbag2 import StoragePlugin, Writer

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.data_files import read

FIX, SCAN, STRING = "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/LaserScan", "std_msgs/msg/String"
START, COUNT = 1_764_468_000_000_000_000, 200


def times() -> list[int]:
    numbers = random.Random(7)
    return [START + i * 10**8 + numbers.randrange(10**8) for i in range(COUNT)]


def latitude(i: int) -> float:
    return 47.0 + i / 7.0


@pytest.fixture(params=["mcap", "sqlite3", "lone mcap"])
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    plugin = StoragePlugin.SQLITE3 if request.param == "sqlite3" else StoragePlugin.MCAP
    folder = tmp_path / "bag"
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        fix = writer.add_connection("/fix", FIX, typestore=STORE)
        scan = writer.add_connection("/scan", SCAN, typestore=STORE)
        word = writer.add_connection("/word", STRING, typestore=STORE)
        for i, time_ns in enumerate(times()):
            status = -1 if i == 3 else 0
            sec, nanosec = divmod(time_ns, 10**9) if i != 5 else (0, 0)
            message = nav_sat_fix(latitude(i), status=status, sec=sec, nanosec=nanosec)
            writer.write(fix, time_ns + 1_000, payload(message))
        writer.write(scan, START, payload(laser_scan(10)))
        writer.write(word, START, payload(made(STRING, data="x")))
    return next(folder.glob("*.mcap")) if request.param == "lone mcap" else folder


def rows(path: Path) -> list[list[str]]:
    with path.open() as file:
        return list(csv.reader(file))


def test_rows_are_exact_and_a_sensor_plays_them(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "fix.csv"
    assert main(["import", str(bag), "--topic", "/fix", "--fields", "latitude,altitude", "-o", str(target)]) == 0
    header, *found = rows(target)
    assert header == ["time", "latitude", "altitude"]
    expected = [(time_ns, i) for i, time_ns in enumerate(times()) if i != 5]
    assert [row[0] for row in found] == [f"{time_ns // 10**9}.{time_ns % 10**9:09d}" for time_ns, _ in expected]
    assert [row[1] for row in found] == ["" if i == 3 else repr(latitude(i)) for _, i in expected]
    words = capsys.readouterr().err
    assert "1 message(s) left out (stamp): the stamp is 0" in words
    assert f"{target}: 199 rows of /fix (sensor_msgs/msg/NavSatFix)" in words
    mesh = tmp_path / "mesh.toml"
    mesh.write_text(
        f'[mesh]\nname = "m"\ndt = 0.1\nstart_time = {START // 10**9}\n[model]\ncontinuous = true\nA = [[0.0]]\n'
        "rho = [1.0]\n[model.prior]\nlower = [-1.0]\nupper = [1.0]\n"
        '[sensors.gps]\nC = [[1.0]]\nr = [1.0]\nfile = "fix.csv"\ntime = "time"\ncolumns = ["latitude"]\n'
        '[filters.f]\nkind = "LSUO"\nsensors = ["gps"]\n'
    )
    file = load(mesh).sensors["gps"].file
    assert file is not None
    data = read(file, 1)
    assert data.time_ns is not None
    assert data.time_ns.tolist() == [time_ns for time_ns, _ in expected]
    assert data.time_half_ns.max() == 0
    assert data.values[0, 0] == latitude(0)


def test_receive_times_are_those_of_the_bag(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(bag), "--topic", "fix", "--fields", "latitude", "--stamp", "receive"]) == 0
    said = capsys.readouterr()
    found = [row[0] for row in csv.reader(said.out.splitlines())][1:]
    assert found == [f"{(t + 1000) // 10**9}.{(t + 1000) % 10**9:09d}" for t in times()]
    assert "give the sensor a time_error" in said.err


def test_topics_and_fields_are_listed(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(bag)]) == 0
    said = capsys.readouterr()
    assert [line.split() for line in said.out.splitlines()] == [
        ["/fix", "200", FIX], ["/scan", "1", SCAN], ["/word", "1", STRING],
    ]  # fmt: skip
    assert main(["import", str(bag), "--topic", "/scan"]) == 0
    assert "ranges[0]" in capsys.readouterr().out.splitlines()
    assert main(["import", str(bag), "--topic", "/word"]) == 0
    assert capsys.readouterr().out.strip() == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--topic", "/fxi"], 'has no topic /fxi; did you mean "/fix"?'),
        (["--topic", "/fix", "--fields", "lattitude"], 'did you mean "latitude"?'),
        (["--topic", "/fix", "--fields", "status"], "is no number"),
        (["--topic", "/word", "--fields", "data"], "is no number, it is a string"),
        (["--topic", "/word", "--fields", "data", "--stamp", "header"], "has no header"),
    ],
)
def test_mistakes_are_named(
    bag: Path, arguments: Sequence[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["import", str(bag), *arguments]) == 2
    assert words in capsys.readouterr().err


def test_a_list_that_is_too_short_leaves_nothing(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(bag), "--topic", "/scan", "--fields", "ranges[500]"]) == 1
    words = capsys.readouterr().err
    assert "1 message(s) left out (fields): ranges[500]: the list of this message is shorter" in words
    assert "no message that can be used" in words


def test_a_file_that_is_there_stays(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "there.csv"
    target.write_text("mine")
    line = ["import", str(bag), "--topic", "/fix", "--fields", "latitude", "-o", str(target)]
    assert main(line) == 1
    assert "--force writes over it" in capsys.readouterr().err
    assert target.read_text() == "mine"
    assert main([*line, "--force"]) == 0
    assert len(rows(target)) == COUNT


@pytest.mark.parametrize("kind", ["missing", "empty", "junk", "folder", "text", "cut"])
def test_what_is_no_bag(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.mcap"
    if kind == "folder":
        path = tmp_path / "folder"
        path.mkdir()
    elif kind == "text":
        path = tmp_path / "x.csv"
        path.write_text("a,b")
    elif kind == "cut":
        written: Any
        with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as written:
            written.write(written.add_connection("/fix", FIX, typestore=STORE), START, payload(nav_sat_fix()))
        path.write_bytes(next((tmp_path / "bag").glob("*.mcap")).read_bytes()[:-100])
    elif kind != "missing":
        path.write_bytes(b"" if kind == "empty" else b"nonsense" * 100)
    assert main(["import", str(path)]) == 2
    words = capsys.readouterr().err
    assert words.startswith(f"{path}: ")
    assert "expected a file .mcap or .db3, or the folder of a rosbag2" in words
