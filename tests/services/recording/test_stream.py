"""The file of a recording: where it lies, what it holds of the run, and a disk that is full."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lsu_mesh_services.recording.part_files import next_part
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.repair import repair
from lsu_mesh_services.recording.synthetic_mesh import Arrival, SyntheticMesh
from rerun.chunk import RrdReader

from lsu_mesh.mesh.config import Configuration, load

Record = Callable[[Configuration, Sequence[Arrival]], Path]


def has_index(path: Path) -> bool:
    """Whether the file ends with an index of its chunks: Rerun warns where it has to make one."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        RrdReader(path).stream().to_chunks()
    return not any("no footer" in str(warning.message) for warning in caught)


@pytest.fixture
def arrivals(configuration: Configuration) -> list[Arrival]:
    return SyntheticMesh(configuration).run(60)


@pytest.mark.parametrize(("override", "is_short"), [("mesh.steps=15000", True), ("mesh.steps=15001", False)])
def test_only_short_runs_have_an_index_which_grows_in_memory_till_their_end(
    configuration: Configuration, arrivals: list[Arrival], record: Record, override: str, is_short: bool
) -> None:
    path = record(load(configuration.path, [override]), arrivals)
    assert has_index(path) is is_short
    assert [message.payload for message in read_raw(path)] == [arrival.payload for arrival in arrivals]
    repair([path], path)
    assert has_index(path)
    assert [message.payload for message in read_raw(path)] == [arrival.payload for arrival in arrivals]


def test_a_file_that_exists_is_never_overwritten(configuration: Configuration, tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    path.write_bytes(b"precious")
    with pytest.raises(FileExistsError) as raised:
        Recorder(configuration, path)
    assert raised.value.errno == errno.EEXIST
    assert raised.value.filename == str(path)
    assert path.read_bytes() == b"precious"
    assert next_part(path) == tmp_path / "run.part2.rrd"
    next_part(path).touch()
    assert next_part(path) == tmp_path / "run.part3.rrd"
    assert next_part(tmp_path / "new.rrd") == tmp_path / "new.rrd"


def test_a_place_that_cannot_be_written_is_an_os_error(configuration: Configuration, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OSError, match="file"):
        Recorder(configuration, tmp_path / "file" / "run.rrd")
    with pytest.raises(OSError, match="proc"):
        Recorder(configuration, Path("/proc/run.rrd"))


@pytest.mark.skipif(os.geteuid() != 0 or shutil.which("mount") is None, reason="a small disk needs root")
def test_a_full_disk_is_a_problem_that_says_so_and_stops_nothing(
    configuration: Configuration, tmp_path: Path, root: Path
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", disk], check=False).returncode != 0:
        pytest.skip("this machine does not let tests mount a disk")
    try:
        # in a process of its own: where Rerun hangs for ever, it does so again when Python ends
        command = [sys.executable, str(root / "tests" / "fill_disk.py"), str(configuration.path), str(disk / "x.rrd")]
        process = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        assert process.returncode == 0, process.stderr
        told = json.loads(process.stdout)
        (last,) = told["problems"]
        words = rf"{disk / 'x.rrd'} takes no more data: only (\d+) bytes are free there; messages that are lost: (\d+)"
        found = re.fullmatch(words, last)
        assert found is not None, last
        assert 0 < int(found[1]) < 2_000_000
        assert int(found[2]) > 100
        stored = read_raw(disk / "x.rrd")
        assert 0 < told["flushed"] + 1 <= sum("/truth/" in message.key for message in stored) < 400
    finally:
        subprocess.run(["umount", "--lazy", disk], check=True)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(configuration: Configuration, tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    with pytest.raises(PermissionError):
        Recorder(configuration, closed / "run.rrd")


def test_a_missing_folder_is_made(configuration: Configuration, tmp_path: Path) -> None:
    recorder = Recorder(configuration, tmp_path / "a" / "b" / "run.rrd")
    recorder.close()
    recorder.close()
    assert read_raw(tmp_path / "a" / "b" / "run.rrd") == []


def test_run_properties_tell_how_to_compute_again(configuration: Configuration, tmp_path: Path) -> None:
    path = tmp_path / "x.rrd"
    Recorder(configuration, path, run_properties={"zenoh": "1.2.3"}).close()
    found: dict[str, Any] = {}
    for chunk in RrdReader(path).stream().filter(content="/__properties/**"):
        batch = chunk.to_record_batch()
        found |= {name: batch.column(name)[0].as_py() for name in batch.schema.names}
    assert found["zenoh"] == ["1.2.3"]
    assert found["configuration"] == [configuration.path.read_text()]
    assert found["model_digest"] == [configuration.digest()]
    assert found["seed"] == ["1"]
    assert found["numpy"] == [np.__version__]
    assert found["cpu"][0]


def test_no_network_is_opened_unless_asked(configuration: Configuration, tmp_path: Path) -> None:
    def listening() -> set[str]:
        rows = [
            line.split() for file in ("tcp", "tcp6") for line in Path(f"/proc/self/net/{file}").read_text().splitlines()
        ]
        inodes = {row[9]: row[1] for row in rows[1:] if len(row) > 9 and row[3] == "0A"}
        own = {os.readlink(entry) for entry in Path("/proc/self/fd").iterdir() if entry.exists()}
        return {address for inode, address in inodes.items() if f"socket:[{inode}]" in own}

    before = listening()
    recorder = Recorder(configuration, tmp_path / "x.rrd")
    assert listening() == before
    recorder.close()
