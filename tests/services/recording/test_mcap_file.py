"""A recording as MCAP, read back by the package ``mcap``."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from local_mesh import LocalMesh
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import FAILURE, OK
from lsu_mesh_services.recording.json_schemas import JsonMessages
from lsu_mesh_services.recording.read import Recording, read_recording
from mcap.reader import make_reader
from recorded_mesh import record

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.message_examples import example
from lsu_mesh.mesh.messages import TYPES, Measurement, Posterior, Smoothed

FAULT = 'sensors.s2.faults=[{kind="lost", from=7, to=7}]'


class Entry(NamedTuple):
    """One message of the file."""

    schema: dict[str, Any]
    topic: str
    log_time: int
    publish_time: int
    sequence: int
    value: dict[str, Any]


@pytest.fixture(scope="module")
def recording(demo: Path, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """The demo after 30 steps; a filter smooths, and one measurement is missing."""
    mesh = LocalMesh(load(demo, ["mesh.steps=30", "filters.cz.lag=4", FAULT]))
    mesh.run(1.0)
    return read_recording(record(mesh, tmp_path_factory.mktemp("recorded") / "demo.rrd"))


@pytest.fixture(scope="module")
def written(recording: Recording) -> Path:
    """Beside the recording."""
    assert main(["recording", "export", str(recording.files[0]), "--format", "mcap"]) == OK
    return recording.files[0].with_suffix(".mcap")


def entries(file: Path) -> Iterator[Entry]:
    with file.open("rb") as opened:
        for schema, channel, message in make_reader(opened).iter_messages(log_time_order=False):
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            yield Entry(
                json.loads(schema.data), channel.topic, message.log_time, message.publish_time, message.sequence,
                json.loads(message.data),
            )  # fmt: skip


def test_every_message_comes_back_with_its_times_and_values(recording: Recording, written: Path) -> None:
    found = list(entries(written))
    assert len(found) == len(recording.received) > 300
    assert {entry.topic for entry in found} == {one.key for one in recording.received}
    for entry, one in zip(found, recording.received, strict=True):
        message = one.message
        assert (entry.topic, entry.log_time, entry.publish_time) == (one.key, one.arrival_ns, message.sent_ns)
        assert entry.sequence == message.seq
        assert (entry.value["step"], entry.value["sent_ns"]) == (message.step, str(message.sent_ns))
        if isinstance(message, Posterior):
            assert (entry.value["lower"], entry.value["upper"]) == (message.lower, message.upper)
            states = entry.value["states"]
            assert [states[f"x{i}"]["lower"] for i in (1, 2, 3)] == message.lower
            assert [states[f"x{i}"]["upper"] for i in (1, 2, 3)] == message.upper
            assert [states[f"x{i}"]["point"] for i in (1, 2, 3)] == message.point
            assert entry.value["support"]["type"]
        elif isinstance(message, Measurement):
            assert entry.value["y"] == message.y
            missing = message.y == [None]
            assert entry.value["outputs"] == ({} if missing else {message.name: message.y[0]})
    kinds = {type(one.message) for one in recording.received}
    assert {Smoothed, Measurement, Posterior} < kinds


def test_the_run_and_its_configuration_are_in_the_file(recording: Recording, written: Path) -> None:
    with written.open("rb") as opened:
        reader = make_reader(opened)
        (metadata,) = list(reader.iter_metadata())
        (attachment,) = list(reader.iter_attachments())
        summary = reader.get_summary()
    assert metadata.metadata == recording.description
    assert attachment.name == "mesh.toml"
    assert tomllib.loads(attachment.data.decode())["mesh"]["name"] == "demo"
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(recording.received)


def test_a_file_that_is_there_is_left_alone(
    recording: Recording, written: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = written.read_bytes()
    assert main(["recording", "export", str(recording.files[0]), "--format", "mcap"]) == FAILURE
    assert "choose a file with -o" in capsys.readouterr().err
    assert written.read_bytes() == before
    other = written.with_name("other.mcap")
    assert main(["recording", "export", str(recording.files[0]), "--format", "mcap", "-o", str(other)]) == OK
    assert len(list(entries(other))) == len(recording.received)


def check_plain(schema: dict[str, Any], is_field: bool = True) -> None:
    """What Foxglove reads of a schema; it refuses a channel with anything else."""
    kind = schema["type"]
    if kind == "object":
        for field in schema["properties"].values():
            check_plain(field)
    elif kind == "array":
        assert is_field, "no lists in lists"
        check_plain(schema["items"], is_field=False)
    else:
        assert kind in ("string", "number", "integer", "boolean"), schema
    assert not {"anyOf", "oneOf", "$ref", "prefixItems", "contentEncoding"} & set(schema)


def check_value(schema: dict[str, Any], value: Any) -> None:
    """A value is as its schema says; fields beside the schema are allowed."""
    kinds = {"string": str, "number": int | float, "integer": int, "boolean": bool, "array": list, "object": dict}
    assert isinstance(value, kinds[schema["type"]]), (schema, value)
    for name, field in schema.get("properties", {}).items():
        if name in value:
            check_value(field, value[name])
    assert set(schema.get("required", ())) <= set(value) if schema["type"] == "object" else True
    for item in value if schema["type"] == "array" else ():
        check_value(schema["items"], item)


@pytest.mark.parametrize("topic", TYPES)
def test_schemas_are_plain_and_true_of_every_topic(topic: str, tmp_path: Path) -> None:
    (tmp_path / "mesh.toml").write_text(
        '[mesh]\nname="m"\ndt=1\n[model]\nA=[[1,0],[0,1]]\nrho=[1,1]\n[model.prior]\nlower=[-1,-1]\nupper=[1,1]\n[plant]\n'
        "[sensors.box]\nC=[[1,0],[0,1]]\nr=[1,1]\n"
    )
    forms = JsonMessages(load(tmp_path / "mesh.toml"))
    schema, value = forms.schema(topic, "box"), forms.form(example(topic), 7)
    check_plain(schema)
    assert schema["type"] == "object"
    check_value(schema, json.loads(json.dumps(value)))
    assert set(schema["properties"]) <= set(value)
    has_states = topic in ("truth", "prediction", "posterior", "smoothed", "fused")
    assert ("states" in value) is has_states
    if has_states:
        assert set(value["states"]) == {"x1", "x2"}


def test_every_message_is_as_its_schema_says(written: Path) -> None:
    for entry in entries(written):
        check_plain(entry.schema)
        check_value(entry.schema, entry.value)
