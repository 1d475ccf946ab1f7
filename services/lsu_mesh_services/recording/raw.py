"""Raw payloads, lossless: every message as it came, the source of truth of a recording.

One entity per topic and name, ``/raw/<topic>/<name>``, and ``/raw/refused`` for payloads that are no message of this
mesh. A row holds ``payload`` (bytes), ``key``, ``arrival_ns`` and ``number``, which orders all rows by arrival: it
counts from the nanosecond at which the recorder started, so that a later part of a recording counts on. By its
``crc`` a reader knows that the disk gave back what was written. Rerun compresses the rows of a flush together.
"""

from __future__ import annotations

import json
import struct
import time
import zlib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr

from lsu_mesh.mesh.keys import parse
from lsu_mesh_services.recording.entity_paths import path
from lsu_mesh_services.recording.timeline import Moment, Stream, step_columns, wall_column

ARCHETYPE = "lsu.Raw"
REFUSED = "/raw/refused"
_TIMES = struct.Struct("<qQ").pack


@dataclass
class _Rows:
    moments: list[Moment] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)
    keys: list[str] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)


def checksum(key: str, arrival_ns: int, number: int, payload: bytes) -> int:
    """CRC-32 of a row: of the payload, after arrival and number (little-endian, 8 bytes each), after the key."""
    return checksums([key], [arrival_ns], [number], [payload])[0]


def checksums(
    keys: Sequence[str], arrivals: Sequence[int], numbers: Sequence[int], payloads: Sequence[bytes]
) -> list[int]:
    """The same of many rows."""
    of_keys = {key: zlib.crc32(key.encode()) for key in set(keys)}
    crc = zlib.crc32
    return [
        crc(payload, crc(_TIMES(arrival, number), of_keys[key]))
        for key, arrival, number, payload in zip(keys, arrivals, numbers, payloads, strict=True)
    ]


def description_checksum(described: Mapping[str, str]) -> str:
    """CRC-32 of what a recording tells of its run, without this checksum itself."""
    told = sorted((name, value) for name, value in described.items() if value and name != "checksum")
    return f"{zlib.crc32(json.dumps(told).encode()):08x}"


def raw_columns(
    keys: Sequence[str],
    arrivals: Sequence[int],
    numbers: Sequence[int],
    payloads: Sequence[bytes],
    *,
    has_checksums: bool = True,
) -> rr.ComponentColumnList:
    """Raw rows as columns, with their checksums; without, of a recording that had none."""
    components: dict[str, Any] = {
        "payload": pa.array(payloads, pa.binary()),
        "key": pa.array(keys, pa.string()),
        "arrival_ns": np.array(arrivals, dtype=np.int64),
        "number": np.array(numbers, dtype=np.uint64),
    }
    if has_checksums:
        components["crc"] = np.array(checksums(keys, arrivals, numbers, payloads), dtype=np.uint32)
    return rr.DynamicArchetype.columns(ARCHETYPE, components=components)


def entity_of(key: str) -> str:
    """The entity at which messages of a key lie."""
    address = parse(key)
    return REFUSED if address is None else path("raw", address.topic, address.name)


class RawStore:
    """Collects raw payloads and sends them in batches."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self._entities: dict[str, str] = {}
        self._rows: defaultdict[str, _Rows] = defaultdict(_Rows)
        self._number = time.time_ns()
        self.waiting_bytes = 0
        """Of the payloads that wait for the next flush."""

    def add(self, key: str, payload: bytes, moment: Moment | None, arrival_ns: int) -> None:
        """Keep a payload for the next flush, at its place in the run; None: it was refused and has none."""
        rows = self._rows[REFUSED if moment is None else self._entity(key)]
        rows.moments.append(Moment(0, arrival_ns) if moment is None else moment)
        rows.payloads.append(payload)
        rows.keys.append(key)
        rows.numbers.append(self._number)
        self._number += 1
        self.waiting_bytes += len(payload)

    def flush(self) -> None:
        """Send all rows that wait."""
        waiting, self._rows, self.waiting_bytes = self._rows, defaultdict(_Rows), 0
        for entity, rows in waiting.items():
            self._send(entity, rows)

    def _send(self, entity: str, rows: _Rows) -> None:
        arrivals = [moment.wall_ns for moment in rows.moments]
        times = [wall_column(arrivals)] if entity == REFUSED else step_columns(rows.moments)
        self._stream.send_columns(entity, times, raw_columns(rows.keys, arrivals, rows.numbers, rows.payloads))

    def _entity(self, key: str) -> str:
        entity = self._entities.get(key)
        if entity is None:
            entity = self._entities[key] = entity_of(key)
        return entity
