"""Reading recordings back, bit by bit, also those whose writer was killed: raw payloads, messages, what the run was."""

from __future__ import annotations

import json
import re
import tempfile
import tomllib
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import pyarrow as pa
from rerun.chunk import RrdReader

from lsu_mesh.mesh.access import recorded_topics
from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import Configuration, ConfigurationError, load_values
from lsu_mesh.mesh.messages import Message
from lsu_mesh_services.recording.raw import ARCHETYPE, REFUSED
from lsu_mesh_services.recording.repair import repair

Found = TypeVar("Found")
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
    description = read_description(files[0])
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


def parts(path: Path) -> tuple[Path, ...]:
    """The file and the parts that a restarted recorder wrote beside it, in their order."""
    pattern = re.compile(re.escape(path.stem) + r"\.part(\d+)" + re.escape(path.suffix))
    beside = path.parent.iterdir() if path.parent.is_dir() else ()
    found = {int(match[1]): file for file in beside if (match := pattern.fullmatch(file.name))}
    return (path, *(found[number] for number in sorted(found)))


def recorded_configuration(path: Path, description: dict[str, str]) -> Configuration:
    """The configuration of the run, flags included. Raises ``ValueError`` where it is not in the recording."""
    try:
        text = description.get("settings")
        values = tomllib.loads(description.get("configuration", "")) if text is None else json.loads(text)
        return load_values(values, Path(description.get("configuration_path", str(path))), reads_files=False)
    except (ValueError, ConfigurationError) as error:
        raise ValueError(f"{path}: holds no configuration of a mesh that this version can read: {error}") from None


def read_description(path: Path) -> dict[str, str]:
    """What the recorder wrote of the run; empty where it did not."""
    described: dict[str, str] = {}
    for batch in _repaired(path, lambda file: _batches(file, PROPERTIES)):
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            values = [] if name.startswith("rerun.") else _flat(column)
            if values:
                described[name] = str(values[0])
    return described


def read_raw(*paths: Path, refused: bool = False) -> list[RawMessage]:
    """The accepted messages of a recording in the order of arrival; ``refused=True``: all payloads, also those refused.

    Several paths are parts of one recording. Raises ``FileNotFoundError``, or ``ValueError`` where a file is no
    recording.
    """
    rows = [row for path in paths for row in _repaired(path, lambda file: _read(file, refused))]
    rows.sort(key=lambda row: row[0])
    return [message for _, message in rows]


def _repaired(path: Path, read: Callable[[Path], list[Found]]) -> list[Found]:
    """What ``read`` finds; of a file in which a message is cut short, what is whole, from a repaired copy."""
    if not path.is_file():
        raise FileNotFoundError(2, "no such recording", str(path))
    try:
        return read(path)
    except RuntimeError:
        with tempfile.TemporaryDirectory(prefix="read-") as folder:
            copy = Path(folder) / "repaired.rrd"
            repair([path], copy)
            return read(copy)


def _batches(path: Path, content: str) -> list[pa.RecordBatch]:
    return [chunk.to_record_batch() for chunk in _chunks(path, content)]


def _read(path: Path, refused: bool) -> list[tuple[int, RawMessage]]:
    chunks = _chunks(path, "/raw/**")
    return [
        row for chunk in chunks if refused or chunk.entity_path != REFUSED for row in _rows(chunk.to_record_batch())
    ]


def _chunks(path: Path, content: str) -> Iterable[Any]:
    with warnings.catch_warnings():
        # A recording that is still written, or whose writer was killed, has no footer.
        warnings.filterwarnings("ignore", message="RRD file has no footer")
        chunks: Iterable[Any] = RrdReader(path).stream().filter(content=content)
    return chunks


def _rows(batch: pa.RecordBatch) -> list[tuple[int, RawMessage]]:
    values = {name: _flat(batch.column(f"{ARCHETYPE}:{name}")) for name in ("number", "key", "arrival_ns", "payload")}
    return [
        (number, RawMessage(key, arrival, payload))
        for number, key, arrival, payload in zip(
            values["number"], values["key"], values["arrival_ns"], values["payload"], strict=True
        )
    ]


def _flat(column: pa.Array) -> Sequence[Any]:
    return list(column.flatten().to_pylist())
