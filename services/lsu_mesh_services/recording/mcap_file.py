"""A recording as MCAP: every message as JSON, one channel per key, for Foxglove and the readers of many languages."""

from __future__ import annotations

from pathlib import Path

from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import Writer

from lsu_mesh import __version__
from lsu_mesh.mesh.config.write import to_toml
from lsu_mesh.mesh.json_form import dumps
from lsu_mesh.mesh.keys import parse
from lsu_mesh_services.recording.json_schemas import JsonMessages
from lsu_mesh_services.recording.read import Recording

SEQUENCES = 2**32
"""Numbers of messages in MCAP have 32 bits; those of a longer run begin again."""


def write_mcap(recording: Recording, path: Path) -> Path:
    """Write a new file. Log times are arrivals at the recorder, publish times those of sending, both in ns since 1970.

    What the recorder wrote of the run is metadata, the configuration an attachment. Raises ``OSError`` where the file
    exists or cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("xb") as file:
        writer = Writer(file)
        writer.start(library=f"lsu-mesh {__version__}")
        _write_run(writer, recording)
        _write_messages(writer, recording)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def _write_run(writer: Writer, recording: Recording) -> None:
    writer.add_metadata("lsu-mesh", dict(recording.description))
    text = to_toml(dict(recording.configuration.values)).encode()
    first = min((one.arrival_ns for one in recording.received), default=0)
    writer.add_attachment(create_time=first, log_time=first, name="mesh.toml", media_type="application/toml", data=text)


def _write_messages(writer: Writer, recording: Recording) -> None:
    forms = JsonMessages(recording.configuration)
    channels: dict[str, int] = {}
    for one in recording.received:
        if one.key not in channels:
            channels[one.key] = _channel(writer, forms, one.key)
        writer.add_message(
            channels[one.key],
            log_time=one.arrival_ns,
            data=dumps(forms.form(one.message, one.arrival_ns)),
            publish_time=one.message.sent_ns,
            sequence=one.message.seq % SEQUENCES,
        )


def _channel(writer: Writer, forms: JsonMessages, key: str) -> int:
    address = parse(key)
    assert address is not None, "the recording holds keys of this protocol"
    schema = writer.register_schema(
        f"lsu.{address.topic}/{address.name}", SchemaEncoding.JSONSchema,
        dumps(forms.schema(address.topic, address.name)),
    )  # fmt: skip
    return writer.register_channel(key, MessageEncoding.JSON, schema)
