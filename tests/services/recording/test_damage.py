"""Zeroed pages, changed bits, torn ends: every message outside of the hurt messages of the file is read and mended."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import FAILURE, OK
from lsu_mesh_services.recording.chunks import read_rows
from lsu_mesh_services.recording.container import ARROW, Frame, batch_of, fields_of, frames
from lsu_mesh_services.recording.read import RawMessage, read_description, read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.repair import repair
from lsu_mesh_services.recording.summary import summary
from lsu_mesh_services.recording.synthetic_mesh import SyntheticMesh, written

from lsu_mesh.mesh.config import load

PAGE = 4096
Hurt = Callable[[bytearray, random.Random], list[tuple[int, int]]]


class Whole(NamedTuple):
    """A sound file, its messages, and where its rows lie."""

    data: bytes
    messages: list[RawMessage]
    rows: list[tuple[int, int, list[RawMessage]]]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    folder = tmp_path_factory.mktemp("whole")
    configuration = load(written(folder).path, ["recorder.flush=200ms", "mesh.steps=20000"])
    recorder = Recorder(configuration, folder / "whole.rrd")
    for arrival in SyntheticMesh(configuration).run(120):
        recorder.record(*arrival)
        recorder.tick(arrival.arrival_ns)
    recorder.close()
    rows = []
    for frame in frames(recorder.path):
        assert isinstance(frame, Frame)
        if frame.kind == ARROW:
            entity, batch = batch_of(fields_of(frame.body).stream())
            if entity.startswith("/raw/"):
                found, _ = read_rows(entity, batch)
                messages = list(map(RawMessage, found.keys, found.arrivals, found.payloads))
                rows.append((frame.start, frame.start + 16 + len(frame.body), messages))
    return Whole(recorder.path.read_bytes(), read_raw(recorder.path), rows)


def zeroed(data: bytearray, rng: random.Random) -> list[tuple[int, int]]:
    """A page of zeros."""
    start = PAGE * rng.randrange(len(data) // PAGE)
    data[start : start + PAGE] = bytes(PAGE)
    return [(start, start + PAGE)]


def zeroed_first(data: bytearray, rng: random.Random) -> list[tuple[int, int]]:
    """The page with the head of the file."""
    data[:PAGE] = bytes(PAGE)
    return [(0, PAGE)]


def flipped(data: bytearray, rng: random.Random) -> list[tuple[int, int]]:
    """A hundred bits."""
    places = [rng.randrange(len(data)) for _ in range(100)]
    for place in places:
        data[place] ^= 1 << rng.randrange(8)
    return [(place, place + 1) for place in places]


def torn(data: bytearray, rng: random.Random) -> list[tuple[int, int]]:
    """The end is missing."""
    size = len(data)
    del data[rng.randrange(size // 2, size) :]
    return [(len(data), size)]


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("hurt", [zeroed, zeroed_first, flipped, torn])
def test_what_is_not_hurt_is_there_afterwards(whole: Whole, tmp_path: Path, hurt: Hurt, seed: int) -> None:
    data = bytearray(whole.data)
    places = hurt(data, random.Random(seed))
    bad, mended = tmp_path / "bad.rrd", tmp_path / "mended.rrd"
    bad.write_bytes(data)
    sound = {
        message
        for start, end, messages in whole.rows
        if not any(first < end and last > start for first, last in places)
        for message in messages
    }
    found = read_raw(bad)
    assert sound <= set(found) <= set(whole.messages), "nothing is lost without need, no changed message is believed"
    done = repair([bad], mended)
    assert read_raw(mended) == found
    assert done.messages == len(found)
    told = summary(bad)
    assert told.lost == sum(loss.messages for loss in done.losses)
    assert sum(peer.messages for peer in told.peers) == len(found)
    if hurt is torn:
        assert told.damage.cut == 1
    else:
        assert told.damage
        first, last = found[0], found[-1]
        inner = whole.messages[whole.messages.index(first) : whole.messages.index(last) + 1]
        assert told.lost == len(inner) - len(found)
    assert summary(mended).lost == told.lost
    assert not summary(mended).damage


def test_losses_are_told_by_message_and_step(whole: Whole, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    start, end, messages = whole.rows[len(whole.rows) // 2]
    data = bytearray(whole.data)
    data[start:end] = bytes(end - start)
    bad = tmp_path / "bad.rrd"
    bad.write_bytes(data)
    assert main(["recording", "info", str(bad)]) == OK
    out = " ".join(capsys.readouterr().out.split())
    assert f"damaged: 1 place(s) of {end - start} bytes, 0 chunk(s), 0 single row(s)" in out
    assert f"lost: {len(messages)} message(s): 1 of step" in out
    assert main(["recording", "repair", str(bad)]) == OK
    assert f"lost: {len(messages)} message(s)" in capsys.readouterr().err
    assert main(["recording", "info", str(bad.with_name("bad.repaired.rrd"))]) == OK


def test_nothing_rescued_is_a_failure_and_no_file(
    whole: Whole, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, data in (("zeros", bytes(len(whole.data))), ("short", whole.data[:5000]), ("empty", b"")):
        bad = tmp_path / f"{name}.rrd"
        bad.write_bytes(data)
        assert main(["recording", "repair", str(bad)]) == FAILURE
        assert "nothing of it can be rescued" in capsys.readouterr().err
    assert sorted(file.name for file in tmp_path.iterdir()) == ["empty.rrd", "short.rrd", "zeros.rrd"]


def test_the_description_of_the_run_outlives_its_first_copy(whole: Whole, tmp_path: Path) -> None:
    (tmp_path / "sound.rrd").write_bytes(whole.data)
    described = read_description(tmp_path / "sound.rrd")
    data = bytearray(whole.data)
    place = next(
        frame.start
        for frame in frames(tmp_path / "sound.rrd")
        if isinstance(frame, Frame) and frame.kind == ARROW and b"/lsu_mesh" in frame.body and b"settings" in frame.body
    )
    data[place : place + 3000] = bytes(3000)
    (tmp_path / "bad.rrd").write_bytes(data)
    assert read_description(tmp_path / "bad.rrd") == described != {}
