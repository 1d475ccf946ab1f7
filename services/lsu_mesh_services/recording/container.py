"""The framing of an ``.rrd`` file, read message by message, past whatever is damaged.

A file is a header of 12 bytes (``RRF2``, version, options) and messages: kind and length of the body, 8 bytes each,
little-endian, and the body, a protobuf message. A body of kind 2 holds an Arrow stream of one record batch, compressed
by LZ4 as a whole. A file with an index has it in a message of kind 0, and 32 bytes behind that.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple

import pyarrow as pa

MAGIC = b"RRF2"
HEADER_BYTES = 12
HEADER = MAGIC + bytes((0, 41, 0, 0, 1, 2, 0, 0))
"""Of a file of Rerun 0.41: its version, LZ4, protobuf."""
END, STORE, ARROW, BLUEPRINT = 0, 1, 2, 3
RECORDING = 1
"""Kind of store that is no blueprint."""
MAX_BODY = 2**28
MAX_CHUNK = 2**31
"""Bytes of a decompressed chunk; a longer one is damage."""
FOOTER_BYTES = 32
WINDOW = 2**20
_PREFIX = struct.Struct("<QQ")
_CANDIDATE = re.compile(rb"[\x00-\x03]\x00{7}[\x00-\xff]{4}\x00{4}\x0a")
"""Kind, a length below 4 GiB, and the tag of the first field of a body."""
_NEXT_BYTES = 17
"""Of a message, by which its beginning is known."""
_LZ4 = pa.Codec("lz4_raw")
_LENGTHS = {1: 8, 5: 4}


class Frame(NamedTuple):
    """A message of the file."""

    start: int
    kind: int
    body: bytes

    def write(self, file: BinaryIO) -> None:
        """Append it to a file."""
        file.write(_PREFIX.pack(self.kind, len(self.body)))
        file.write(self.body)


class Hole(NamedTuple):
    """Bytes of a file that hold no message."""

    start: int
    end: int


class Fields(NamedTuple):
    """What a body of kind 2 says: the store, and the Arrow stream and its size before compression."""

    store: bytes
    is_compressed: bool
    size: int
    payload: bytes

    def stream(self) -> pa.Buffer:
        """The Arrow stream. Raises ``ValueError`` where it cannot be decompressed."""
        if not self.is_compressed:
            return pa.py_buffer(self.payload)
        if not 0 < self.size <= min(MAX_CHUNK, 256 * len(self.payload) + 1024):
            raise ValueError(f"{len(self.payload)} bytes do not hold {self.size}")
        try:
            return _LZ4.decompress(self.payload, self.size)
        except (OSError, pa.ArrowException) as error:
            raise ValueError(str(error)) from None


def frames(path: Path) -> Iterator[Frame | Hole]:
    """The messages of a file in their order, and what lies between them where it is damaged.

    A message of which a part is missing at the end is a hole. Raises ``OSError`` where the file cannot be read.
    """
    size = path.stat().st_size
    with path.open("rb", buffering=WINDOW) as file:
        position = 0
        while position < size:
            file.seek(position)
            skipped = _skipped(file.read(FOOTER_BYTES), is_first=position == 0)
            if skipped:
                position += skipped
                continue
            found = _frame(file, position, size)
            if isinstance(found, Frame):
                yield found
                position += _PREFIX.size + len(found.body)
                continue
            after = _next_start(file, position, size)
            yield Hole(position, after)
            position = after


def _skipped(head: bytes, *, is_first: bool) -> int:
    """Length of what stands here beside messages: the header of a file, or the end of one with an index."""
    if head.startswith(MAGIC) or (is_first and head[4:HEADER_BYTES] == HEADER[4:]):
        return HEADER_BYTES
    return FOOTER_BYTES if head[20:28] == b"RRF2FOOT" else 0


def _frame(file: BinaryIO, position: int, size: int) -> Frame | None:
    file.seek(position)
    prefix = file.read(_PREFIX.size)
    if len(prefix) < _PREFIX.size:
        return None
    kind, length = _PREFIX.unpack(prefix)
    if kind > BLUEPRINT or not 0 < length <= min(MAX_BODY, size - position - _PREFIX.size):
        return None
    body = file.read(length)
    is_whole = _begins_message(file.read(_NEXT_BYTES)) or is_protobuf(body, {5} if kind == ARROW else set())
    return Frame(position, kind, body) if is_whole else None


def _begins_message(head: bytes) -> bool:
    """Whether a message begins with these bytes, by which the one before them is whole."""
    return len(head) == _NEXT_BYTES and _CANDIDATE.match(head) is not None and head[0] != END


def _next_start(file: BinaryIO, position: int, size: int) -> int:
    """Where the next message begins behind a damaged place; the end of the file where none does."""
    overlap = _PREFIX.size + 1
    window_start = position + 1
    while window_start < size:
        file.seek(window_start)
        window = file.read(WINDOW)
        for match in _CANDIDATE.finditer(window):
            start = window_start + match.start()
            if _frame(file, start, size) is not None:
                return start
        if len(window) < WINDOW:
            break
        window_start += WINDOW - overlap
    return size


def is_protobuf(data: bytes, needed: set[int]) -> bool:
    """Whether this is a whole protobuf message, not an empty one, with the fields that it needs."""
    try:
        numbers = {number for number, _, _ in protobuf(data)}
    except ValueError:
        return False
    return bool(numbers) and needed <= numbers


def protobuf(data: bytes) -> Iterator[tuple[int, int, bytes | int]]:
    """Fields ``(number, wire type, value)``. Raises ``ValueError`` where it is no whole protobuf message."""
    at, end = 0, len(data)
    while at < end:
        tag, at = _varint(data, at)
        number, wire = tag >> 3, tag & 7
        if not 0 < number < 64:
            raise ValueError(f"field {number}")
        if wire == 0:
            value, at = _varint(data, at)
            yield number, wire, value
            continue
        length = _LENGTHS.get(wire, -1)
        if wire == 2:
            length, at = _varint(data, at)
        if not 0 <= length <= end - at:
            raise ValueError(f"field {number} of type {wire} does not fit")
        yield number, wire, data[at : at + length]
        at += length


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        if at >= len(data) or shift > 63:
            raise ValueError("a number does not end")
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
        shift += 7


def _number_bytes(value: int) -> bytes:
    parts = bytearray()
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    return bytes((*parts, value))


def fields_of(body: bytes) -> Fields:
    """What a body of kind 2 says. Raises ``ValueError`` where it says nothing that can be read."""
    found = {number: value for number, _, value in protobuf(body)}
    store, payload, size = found.get(1), found.get(5), found.get(3, 0)
    if not isinstance(store, bytes) or not isinstance(payload, bytes) or not isinstance(size, int):
        raise ValueError("the fields of a chunk are damaged")
    return Fields(store, found.get(2) == 2, size, payload)


def store_of(frame: Frame) -> bytes:
    """The store that a message belongs to: its kind and identifiers, as they are encoded; empty where it says none."""
    try:
        found = {number: value for number, _, value in protobuf(frame.body)}
        inner = {number: value for number, _, value in protobuf(_as_bytes(found.get(2)))} if frame.kind == STORE else {}
    except ValueError:
        return b""
    return _as_bytes(inner.get(2) if frame.kind == STORE else found.get(1))


def _as_bytes(value: bytes | int | None) -> bytes:
    return value if isinstance(value, bytes) else b""


def is_about(stream: pa.Buffer, words: Sequence[bytes]) -> bool:
    """Whether the head of an Arrow stream, which names the entity, holds one of the words: quick, and no proof."""
    data = memoryview(stream)
    head = bytes(data[: 8 + int.from_bytes(data[4:8], "little")])
    return any(word in head for word in words)


def batch_of(stream: pa.Buffer) -> tuple[str, pa.RecordBatch]:
    """Entity and rows of a chunk, checked throughout. Raises ``ValueError`` where the chunk is damaged."""
    try:
        with pa.ipc.open_stream(stream) as reader:
            metadata = reader.schema.metadata or {}
            batch = reader.read_next_batch()
        batch.validate(full=True)
        return metadata[b"rerun:entity_path"].decode(), batch
    except (OSError, KeyError, StopIteration, UnicodeDecodeError, MemoryError, pa.ArrowException) as error:
        raise ValueError(f"{type(error).__name__}: {error}") from None


def check_texts(metadata: Mapping[bytes, bytes], fields: Sequence[pa.Field]) -> None:
    """Raises ``ValueError`` where a name is no text: Rerun ends the process for that."""
    for text in (*metadata.keys(), *metadata.values()):
        text.decode()
    for field in fields:
        if not isinstance(field.name, str):
            raise ValueError("a column without a name")
        kind = field.type
        inner = [kind.field(i) for i in range(kind.num_fields)] if pa.types.is_nested(kind) else []
        check_texts(field.metadata or {}, inner)


def new_store(store: bytes) -> Frame:
    """The message that names a store, for one whose own is damaged: row 0 of Python 3.11, written by this version."""
    row = b"\x09" + bytes(8) + b"\x11" + bytes(8)
    source, version = b"\x08\x02\x12\x08\x0a\x06\x08\x03\x10\x0b\x18\x07", b"\x08\x80R"
    info = b"".join(_field(number, value) for number, value in ((2, store), (5, source), (6, version)))
    return Frame(0, STORE, _field(1, row) + _field(2, info))


def _field(number: int, value: bytes) -> bytes:
    return _number_bytes(number << 3 | 2) + _number_bytes(len(value)) + value


def with_batch(frame: Frame, batch: pa.RecordBatch, store: bytes = b"") -> Frame:
    """A message of kind 2 with other rows, not compressed, and of another store where one is given."""
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, batch.schema) as writer:
        writer.write_batch(batch)
    payload = sink.getvalue().to_pybytes()
    changed: dict[int, int | bytes] = {2: 1, 3: len(payload), 5: payload}
    if store:
        changed[1] = store
    body = bytearray()
    for number, wire, old in protobuf(frame.body):
        value = changed.get(number, old)
        body += _number_bytes(number << 3 | wire)
        if isinstance(value, int):
            body += _number_bytes(value)
        else:
            body += (_number_bytes(len(value)) if wire == 2 else b"") + value
    return Frame(frame.start, frame.kind, bytes(body))
