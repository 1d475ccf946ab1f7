"""``lsu-mesh replay``: verification, replays that give the same sets, comparisons with other filters, mistakes."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import pytest
from local_mesh import LocalMesh
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import NOT_MET, OK, USAGE
from lsu_mesh_services.recording.part_files import parts
from lsu_mesh_services.recording.read import read_recording
from msgspec import structs
from recorded_mesh import record

from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import Measurement, Message, Posterior, encode

Run = Callable[..., tuple[int, list[dict[str, Any]], str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """``lsu-mesh replay … --json``: exit code, JSON lines, stderr."""

    def call(*arguments: object) -> tuple[int, list[dict[str, Any]], str]:
        code = main(["replay", *map(str, arguments), "--json"])
        out, err = capsys.readouterr()
        return code, [json.loads(line) for line in out.splitlines()], err

    return call


def of(kind: str, lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [line for line in lines if line["type"] == kind]


def test_a_recording_is_verified(run: Run, recording: Path) -> None:
    code, lines, _ = run(recording, "--verify")
    assert code == OK
    (summary,) = of("verification", lines)
    assert summary["holds"]
    assert summary["exact"] == 3 * 60 * 2 + 60
    assert summary["different"] == summary["unverifiable"] == summary["miss_truth"] == 0
    assert {line["peer"] for line in of("peer", lines)} == {"filter/box", "filter/cz", "filter/para", "fusion/main"}


def test_for_people_too(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(recording), "--verify"]) == OK
    out = capsys.readouterr().out
    assert "420 sets recomputed from their provenance" in out
    assert "equal, bit by bit" in out
    assert "hold it" in out


def test_one_bit_of_one_measurement(run: Run, mesh: LocalMesh, tmp_path: Path) -> None:
    def flip(message: Message, payload: bytes) -> bytes:
        if not isinstance(message, Measurement) or (message.name, message.step) != ("s2", 31):
            return payload
        at = payload.index(b"\xa1y\x91\xcb") + 4 + 4  # MessagePack: the key "y", a list of one, a float of 8 bytes
        changed = bytes([*payload[:at], payload[at] ^ 1, *payload[at + 1 :]])
        assert changed != payload
        return changed

    code, lines, _ = run(record(mesh, tmp_path / "flipped.rrd", flip), "--verify")
    assert code == NOT_MET
    first = of("difference", lines)[0]
    assert (first["peer"], first["step"]) in {("filter/box", 31), ("filter/cz", 31)}
    assert first["recorded"] != first["recomputed"]
    assert {line["step"] for line in of("difference", lines)} == {31}


def newer(message: Message, payload: bytes) -> bytes:
    """What a peer of a later release sends."""
    fields = msgpack.unpackb(payload) | {"colour": "red"}
    if "support" in fields:
        fields["support"]["shade"] = [0.5]
    return msgpack.packb(fields)


@functools.cache
def first_fields() -> dict[str, set[str]]:
    """The fields of each topic in the first release."""
    first = Path(__file__).parents[2] / "mesh" / "data" / "payloads-0.1" / "first.jsonl"
    return {line["topic"]: set(line["fields"]) for line in map(json.loads, first.read_text().splitlines())}


def older(message: Message, payload: bytes) -> bytes:
    """What a peer of the first release sends."""
    return msgpack.packb(
        {name: value for name, value in msgpack.unpackb(payload).items() if name in first_fields()[message.topic]}
    )


@pytest.mark.parametrize("change", [newer, older])
def test_recordings_of_other_releases_are_verified(
    run: Run, mesh: LocalMesh, tmp_path: Path, change: Callable[[Message, bytes], bytes]
) -> None:
    """Messages of the first release state no number: their sets count as those of algorithm 1, and are equal here."""
    path = record(mesh, tmp_path / "other.rrd", change)
    payloads = [one.payload for one in read_recording(path).received]
    assert payloads == [change(message, encode(message)) for _, message in mesh.sent], "kept as they came"
    code, lines, _ = run(path, "--verify")
    assert code == OK
    (summary,) = of("verification", lines)
    assert summary["exact"] == 3 * 60 * 2 + 60
    assert summary["unverifiable"] == 0
    assert summary["different"] == summary["miss_truth"] == 0


def test_a_recording_tells_which_fields_were_not_read(
    mesh: LocalMesh, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = record(mesh, tmp_path / "newer.rrd", newer)
    found = read_recording(path).unknown_fields
    assert found["posterior.support.shade"] == 3 * 60
    assert set(found) >= {f"{topic}.colour" for topic in ("truth", "input", "measurement", "prediction", "fused")}
    assert read_recording(recording).unknown_fields == {}
    assert main(["recording", "info", str(path)]) == OK
    assert "fields of a newer version, not read: " in capsys.readouterr().out


def test_a_payload_that_is_no_message_any_more_is_named(run: Run, mesh: LocalMesh, tmp_path: Path) -> None:
    def spoil(message: Message, payload: bytes) -> bytes:
        is_it = isinstance(message, Measurement) and (message.name, message.step) == ("s1", 10)
        return payload.replace(b"\xa1y", b"\xa1z") if is_it else payload

    code, lines, _ = run(record(mesh, tmp_path / "spoilt.rrd", spoil), "--verify")
    assert code == NOT_MET
    assert "measurement/s1" in of("damaged", lines)[0]["text"]
    assert of("unverifiable", lines), "what used it cannot be recomputed"
    assert not of("difference", lines)


def test_a_replay_gives_the_same_sets(run: Run, mesh: LocalMesh, recording: Path, tmp_path: Path) -> None:
    target = tmp_path / "again.rrd"
    code, lines, _ = run(recording, "--record", target)
    assert code == OK
    again = read_recording(target)
    sets = {(m.name, m.step): m for m in (one.message for one in again.received) if isinstance(m, Posterior)}
    assert len(sets) == 240
    for name in mesh.estimators():
        for k, recorded in mesh.newest(name).items():
            assert said_of_the_state(sets[name, k]) == said_of_the_state(recorded), (name, k)
    assert of("replay", lines)[0]["times_real_time"] > 0
    assert run(target, "--verify")[0] == OK


def said_of_the_state(message: Posterior) -> tuple[object, ...]:
    """The set and all that is said of it, without when and by whom."""
    size = (message.log_volume, message.volume_of)
    return message.support, message.lower, message.upper, message.point, size, message.status, message.kind


def test_other_filters_beside_the_recorded_ones(run: Run, recording: Path, tmp_path: Path, demo: Path) -> None:
    other = tmp_path / "other.toml"
    text = demo.read_text().replace('kind = "LSUP"\nsensors = ["s1"]', 'kind = "LSUPB"\nsensors = ["s1", "s2", "s3"]')
    other.write_text(text.replace('name = "demo"', 'name = "other"'))
    target = tmp_path / "both.rrd"
    code, lines, _ = run(recording, "--with", other, "--record", target)
    assert code == OK
    rows = {(line["run"], line["name"]): line for line in of("estimator", lines)}
    assert rows["replayed", "para-new"]["kind"] == "LSUPB"
    assert rows["replayed", "para-new"]["width"] < rows["recorded", "para"]["width"]
    assert rows["replayed", "main-new"]["inside"] == 1.0
    both = read_recording(target)
    assert set(both.configuration.filters) == {"box", "cz", "para", "box-new", "cz-new", "para-new"}
    assert both.configuration.fusion["main-new"].sources == ("box-new", "cz-new", "para-new")
    code, lines, _ = run(target, "--verify")
    assert (code, of("verification", lines)[0]["exact"]) == (OK, 2 * 420)


def test_a_comparison_lies_beside_the_recording_and_overwrites_nothing(
    run: Run, mesh: LocalMesh, tmp_path: Path
) -> None:
    recording = record(mesh, tmp_path / "run.rrd")
    for name in ("run-with-changed.rrd", "run-with-changed-2.rrd"):
        code, lines, _ = run(recording, "-X", "filters.cz.max_generators=6")
        assert code == OK
        assert of("replay", lines)[0]["recording"] == str(tmp_path / name)
        assert (tmp_path / name).is_file()
    assert parts(recording) == (recording,)


@pytest.mark.parametrize(
    ("replaced", "by", "words"),
    [
        ("s1", "s9", "sensor 's9' is not in the recording"),
        ('kind = "LSUO"', 'kind = "LSUX"', "LSUX"),
        ("B = [[0.1], [0.6], [0.3]]", "B = [[0.1, 0.0], [0.6, 0.0], [0.3, 0.0]]", "has 2 inputs"),
    ],
)
def test_another_mesh_that_does_not_fit_is_an_error(
    run: Run, recording: Path, tmp_path: Path, demo: Path, replaced: str, by: str, words: str
) -> None:
    other = tmp_path / "other.toml"
    other.write_text(demo.read_text().replace(replaced, by))
    code, _, err = run(recording, "--with", other)
    assert code == USAGE
    assert words in err


def test_the_options_of_a_run_are_in_its_recording(mesh: LocalMesh, recording: Path, demo: Path) -> None:
    found = read_recording(recording).configuration
    assert found.mesh.steps == 60
    expected = load(demo, ["mesh.steps=60"])
    assert (found.values, found.mesh, found.filters) == (expected.values, expected.mesh, expected.filters)


def test_real_data_are_verified_without_their_file(run: Run, tmp_path: Path) -> None:
    data, file = tmp_path / "gauge.csv", tmp_path / "gauge.toml"
    data.write_text("t,height\n" + "".join(f"{100 + 0.5 * k},{0.1 * k}\n" for k in range(1, 31)))
    file.write_text(
        '[mesh]\nname = "gauge"\ndt = 0.5\nrate = 50.0\nstart_time = 100.0\n'
        "[model]\nA = [[1.0, 0.5], [0.0, 1.0]]\nrho = [0.1, 0.1]\n"
        "prior = { lower = [-10.0, -10.0], upper = [10.0, 10.0] }\n"
        '[sensors.gauge]\nC = [[1.0, 0.0]]\nr = [0.5]\nfile = "gauge.csv"\ntime = "t"\n'
        '[filters.box]\nkind = "LSUO"\nsensors = ["gauge"]\n[filters.cz]\nkind = "LSUCZ"\nsensors = ["gauge"]\n'
        '[fusion.main]\nsources = ["box", "cz"]\n'
    )
    mesh = LocalMesh(load(file))
    mesh.run(1.0)
    recording = record(mesh, tmp_path / "gauge.rrd")
    data.unlink()
    code, lines, _ = run(recording, "--verify")
    assert code == OK
    assert of("verification", lines)[0]["exact"] > 100
    assert of("verification", lines)[0]["hold_truth"] == 0


def test_mistakes_are_said(run: Run, recording: Path, tmp_path: Path) -> None:
    text = tmp_path / "text.rrd"
    text.write_text("no recording")
    assert run(tmp_path / "nowhere.rrd")[0] == USAGE
    code, _, err = run(text)
    assert code == USAGE
    assert "not a Rerun recording" in err
    code, _, err = run(recording, "--verify", "-X", "mesh.steps=3")
    assert code == USAGE
    assert "leave out -X" in err


def test_a_recording_of_another_arithmetic(
    mesh: LocalMesh, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def wider(message: Message, payload: bytes) -> bytes:
        is_it = isinstance(message, Posterior) and message.name == "cz" and message.step > 50
        return encode(structs.replace(message, log_volume=9.5)) if is_it else payload

    path = record(mesh, tmp_path / "other.rrd", wider)
    numbers = json.loads(read_recording(path).description["algorithms"])
    assert numbers == {"LSUCZ": 3, "LSUO": 2, "LSUP": 3, "intersect": 4}
    monkeypatch.setattr(LSUCZ, "algorithm", 4)
    assert main(["replay", str(path), "--verify"]) == OK
    out = capsys.readouterr().out
    assert "10 sets are unverifiable: LSUCZ algorithm 3, this is 4" in out
    assert "410 sets recomputed from their provenance" in out


def test_a_false_claim_is_told(run: Run, mesh: LocalMesh, tmp_path: Path) -> None:
    def weaken(message: Message, payload: bytes) -> bytes:
        is_it = isinstance(message, Posterior) and (message.name, message.step) == ("box", 10)
        return payload.replace(b"\xa8declared", b"\xa7learned", 1) if is_it else payload

    code, lines, _ = run(record(mesh, tmp_path / "weaker.rrd", weaken), "--verify")
    assert code == NOT_MET
    claims = {(line["peer"], line["step"], line["field"], line["recomputed"]) for line in of("false_claim", lines)}
    assert ("filter/box", 10, "guarantee", "declared") in claims
    (summary,) = of("verification", lines)
    assert summary["false_claims"] == len(claims)
    assert summary["different"] == 0
