"""The raw rows of a file, chunk by chunk, and what of it is damaged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from lsu_mesh.array_types import Flags, Integers
from lsu_mesh_services.recording.container import ARROW, Frame, Hole, batch_of, fields_of, frames, is_about
from lsu_mesh_services.recording.raw import ARCHETYPE, REFUSED, checksum, checksums

RAW = "/raw/"
HEAD_BYTES = 8192
"""Of a compressed chunk, within which its first names stand as they are."""


@dataclass
class Damage:
    """What could not be read of a recording."""

    places: int = 0
    """Places of the files where no message stands."""
    bytes: int = 0
    """Their size, without an end that is cut short."""
    chunks: int = 0
    """Messages of the files whose content is damaged."""
    rows: int = 0
    """Rows that are not what was written, by their checksum."""
    cut: int = 0
    """Files that end within a message, as after the kill of a recorder."""
    files: list[str] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.places or self.chunks or self.rows)

    def add_hole(self, hole: Hole, path: Path) -> None:
        """A place of a file; at its end, it is cut short."""
        if hole.end >= path.stat().st_size:
            self.cut += 1
        else:
            self.places += 1
            self.bytes += hole.end - hole.start
        self._name(path)

    def add_chunk(self, path: Path, *, rows: int = 0) -> None:
        """A message whose content is damaged: so many of its rows, or all where that is not known."""
        self.chunks += 0 if rows else 1
        self.rows += rows
        self._name(path)

    def join(self, other: Damage) -> None:
        """Add what another one counted."""
        self.places += other.places
        self.bytes += other.bytes
        self.chunks += other.chunks
        self.rows += other.rows
        self.cut += other.cut
        self.files += [name for name in other.files if name not in self.files]

    def _name(self, path: Path) -> None:
        if str(path) not in self.files:
            self.files.append(str(path))


class Rows(NamedTuple):
    """Raw rows of one entity."""

    entity: str
    keys: Sequence[str]
    arrivals: Sequence[int]
    payloads: Sequence[bytes]
    numbers: Integers
    steps: Integers
    """0 where a row is of none."""
    is_checked: bool
    """Whether the rows have checksums, all of which are right."""

    @property
    def is_refused(self) -> bool:
        """Whether these payloads were refused when they came."""
        return self.entity == REFUSED


def raw_rows(path: Path, damage: Damage, *, quick: bool = False) -> Iterator[Rows]:
    """The raw rows of a file that are whole, in the order of the file; ``damage`` gets the rest.

    ``quick`` leaves chunks out by a look at their compressed head. A chunk that it wrongly leaves out would show as
    lost messages. Raises ``OSError`` where the file cannot be read.
    """
    for frame in frames(path):
        if isinstance(frame, Hole):
            damage.add_hole(frame, path)
        elif frame.kind == ARROW and not (quick and RAW.encode() not in frame.body[:HEAD_BYTES]):
            rows = _rows_of(frame, path, damage)
            if rows is not None and len(rows.keys):
                yield rows


def _rows_of(frame: Frame, path: Path, damage: Damage) -> Rows | None:
    try:
        stream = fields_of(frame.body).stream()
        if not is_about(stream, (RAW.encode(),)):
            return None
        entity, batch = batch_of(stream)
        if not entity.startswith(RAW):
            return None
        rows, good = read_rows(entity, batch)
    except ValueError:
        damage.add_chunk(path)
        return None
    if not good.all():
        damage.add_chunk(path, rows=int((~good).sum()))
    return rows


def read_rows(entity: str, batch: pa.RecordBatch) -> tuple[Rows, Flags]:
    """The rows of a chunk that are what was written, and which ones those are.

    Raises ``ValueError`` where a column is missing.
    """
    keys, arrivals = _column(batch, "key"), _column(batch, "arrival_ns")
    payloads, numbers = _column(batch, "payload"), _column(batch, "number")
    steps = _steps(batch)
    has_checksums = f"{ARCHETYPE}:crc" in batch.schema.names
    expected = _column(batch, "crc") if has_checksums else [None] * batch.num_rows
    is_complete = not any(None in column for column in (keys, arrivals, payloads, numbers))
    if has_checksums and is_complete and checksums(keys, arrivals, numbers, payloads) == expected:
        rows = Rows(
            entity, keys, arrivals, payloads, numbers=np.array(numbers, dtype=np.int64), steps=steps, is_checked=True
        )
        return rows, np.ones(len(keys), dtype=np.bool_)
    columns = list(zip(keys, arrivals, numbers, payloads, expected, strict=True))
    good = np.fromiter(map(_is_right, columns), dtype=np.bool_, count=len(columns))
    if not good.all():
        kept = [column for column, is_good in zip(columns, good, strict=True) if is_good]
        parts = [list(part) for part in zip(*kept, strict=True)] or [[], [], [], [], []]
        keys, arrivals, numbers, payloads, expected = parts
        steps = steps[good]
    is_checked = None not in expected
    return Rows(
        entity, keys, arrivals, payloads, numbers=np.array(numbers, dtype=np.int64), steps=steps, is_checked=is_checked
    ), good


def _is_right(row: tuple[Any, Any, Any, Any, Any]) -> bool:
    """Whether a row is complete and has the checksum that was written with it, where one was."""
    key, arrival, number, payload, expected = row
    if expected is not None:
        return key is not None and payload is not None and checksum(key, arrival, number, payload) == expected
    return not (key is None or arrival is None or number is None or payload is None or number >= 2**63)


def _column(batch: pa.RecordBatch, name: str) -> list[Any]:
    if f"{ARCHETYPE}:{name}" not in batch.schema.names:
        raise ValueError(f"no column {name}")
    column = batch.column(f"{ARCHETYPE}:{name}")
    if not pa.types.is_list(column.type):
        raise ValueError(f"column {name} holds no lists")
    flat = column.values  # of all rows, where each has one value
    if column.null_count == 0 and flat.null_count == 0 and len(flat) == len(column):
        return list(flat.to_numpy(zero_copy_only=False).tolist())
    return [values[0] if values else None for values in column.to_pylist()]


def _steps(batch: pa.RecordBatch) -> Integers:
    if "step" not in batch.schema.names:
        return np.zeros(batch.num_rows, dtype=np.int64)
    column = batch.column("step")
    column = column.fill_null(0) if column.null_count else column
    steps: Integers = column.to_numpy(zero_copy_only=False).astype(np.int64)
    return steps
