"""Reading recordings back, bit by bit, also those whose writer was killed: raw payloads, messages, what the run was."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from lsu_mesh.mesh.access import recorded_topics
from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import Configuration, ConfigurationError, load_values
from lsu_mesh.mesh.messages import Message
from lsu_mesh_services.recording.chunks import Damage, raw_rows
from lsu_mesh_services.recording.container import ARROW, Frame, batch_of, fields_of, frames, is_about
from lsu_mesh_services.recording.part_files import parts
from lsu_mesh_services.recording.raw import description_checksum

PROPERTIES = "/__properties/lsu_mesh"


class RawMessage(NamedTuple):
    """One message as the recorder received it."""

    key: str
    arrival_ns: int
    payload: bytes


class Received(NamedTuple):
    """A message with its arrival, nanoseconds since 1970, and the bytes that it came in."""

    arrival_ns: int
    key: str
    payload: bytes
    message: Message


@dataclass(frozen=True)
class Recording:
    """A recorded run."""

    files: tuple[Path, ...]
    """The file and its later parts."""
    description: dict[str, str]
    """What the recorder wrote of the run: configuration, seed, versions, processor."""
    configuration: Configuration
    received: list[Received]
    """Every message once, in the order of arrival."""
    damaged: list[str]
    """Payloads that were accepted when they were recorded and are no message any more, in words."""
    unknown_fields: dict[str, int] = field(default_factory=dict)
    """How often a field came that a newer peer wrote and this version does not know, by topic and name."""


def read_recording(path: Path) -> Recording:
    """A recording with all its parts.

    Raises ``OSError`` where the file cannot be read, ``ValueError`` where it is no recording of a mesh.
    """
    files = parts(path)
    for file in files:
        check_recording(file)
    description = read_description(*files)
    configuration = recorded_configuration(path, description)
    admission = Admission(configuration, recorded_topics(configuration))
    received, damaged = [], []
    for raw in read_raw(*files):
        duplicates = admission.duplicates
        message = admission.admit(raw.key, raw.payload)
        if message is not None:
            received.append(Received(raw.arrival_ns, raw.key, raw.payload, message))
        elif admission.duplicates == duplicates:
            damaged.append(admission.last_refusal)
    return Recording(
        files=files,
        description=description,
        configuration=configuration,
        received=received,
        damaged=damaged,
        unknown_fields=dict(admission.unknown_fields),
    )


def recorded_configuration(path: Path, description: dict[str, str]) -> Configuration:
    """The configuration of the run, flags included. Raises ``ValueError`` where it is not in the recording."""
    try:
        text = description.get("settings")
        values = tomllib.loads(description.get("configuration", "")) if text is None else json.loads(text)
        return load_values(values, Path(description.get("configuration_path", str(path))), reads_files=False)
    except (ValueError, ConfigurationError) as error:
        raise ValueError(f"{path}: holds no configuration of a mesh that this version can read: {error}") from None


def read_description(*paths: Path) -> dict[str, str]:
    """What the recorder wrote of the run; empty where it did not, or where every copy of it is damaged.

    The first copy whose checksum is right, of several parts, else the first one.
    """
    first: dict[str, str] = {}
    for path in paths:
        for frame in frames(path):
            described = _described(frame) if isinstance(frame, Frame) and frame.kind == ARROW else {}
            if described and described.get("checksum") in (None, description_checksum(described)):
                return described
            first = first or described
    return first


def _described(frame: Frame) -> dict[str, str]:
    try:
        stream = fields_of(frame.body).stream()
        if not is_about(stream, (PROPERTIES.encode(),)):
            return {}
        entity, batch = batch_of(stream)
    except ValueError:
        return {}
    described: dict[str, str] = {}
    for name, column in zip(batch.schema.names, batch.columns, strict=True):
        values = [] if name.startswith("rerun.") or not pa.types.is_list(column.type) else column.flatten().to_pylist()
        if values and entity == PROPERTIES:
            described[name] = str(values[0])
    return described


def read_raw(*paths: Path, refused: bool = False, damage: Damage | None = None) -> list[RawMessage]:
    """The accepted messages of a recording in the order of arrival; ``refused=True``: all payloads, also those refused.

    Several paths are parts of one recording. What is damaged is left out, and told to ``damage``. Raises
    ``FileNotFoundError``, or ``ValueError`` where a file is no recording.
    """
    rows: list[tuple[int, RawMessage]] = []
    damage = Damage() if damage is None else damage
    for path in paths:
        check_recording(path)
        for found in raw_rows(path, damage):
            if refused or not found.is_refused:
                messages = map(RawMessage, found.keys, found.arrivals, found.payloads)
                rows += zip(found.numbers.tolist(), messages, strict=True)
    rows.sort(key=lambda row: row[0])
    return [message for _, message in rows]


def check_recording(path: Path) -> None:
    """Raises ``FileNotFoundError``, or ``ValueError`` where a file holds nothing of a recording."""
    if not path.is_file():
        raise FileNotFoundError(2, "no such recording", str(path))
    if not any(isinstance(frame, Frame) for frame in frames(path)):
        raise ValueError(f"{path}: not a Rerun recording, or nothing of it can be read")
