"""Repairing, joining and compacting recordings, on top of ``rerun rrd optimize``.

A recorder that was killed in the middle of a write, or a full disk, leaves a message cut short; a bad disk leaves pages
of zeros and changed bits. Viewer and reader refuse such files. A repaired file holds every whole message, and of the
raw rows all that have the checksum that was written with them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple

import pyarrow as pa
from rerun import archetypes
from rerun.blueprint import archetypes as blueprint_archetypes
from rerun.chunk import Chunk

from lsu_mesh_services.recording.chunks import RAW, Damage, Rows, raw_rows, read_rows
from lsu_mesh_services.recording.container import (
    ARROW,
    END,
    HEADER,
    STORE,
    Frame,
    Hole,
    batch_of,
    check_texts,
    fields_of,
    frames,
    new_store,
    store_of,
    with_batch,
)
from lsu_mesh_services.recording.losses import Loss, Losses
from lsu_mesh_services.recording.raw import entity_of, raw_columns
from lsu_mesh_services.recording.rerun_programs import quiet_environment
from lsu_mesh_services.recording.timeline import Moment, step_columns, wall_column

KINDS = {"rerun.archetypes": archetypes, "rerun.blueprint.archetypes": blueprint_archetypes}
"""Where Rerun has what is drawn."""
RECORDING_STORE = bytes((8, 1))
"""How the name of a store begins that is no blueprint."""


class Repaired(NamedTuple):
    """What a repair found damaged, and the messages that were lost by it."""

    damage: Damage
    losses: list[Loss]
    messages: int
    """Raw messages in the repaired file, with those that were refused."""


def repair(sources: Sequence[Path], target: Path) -> Repaired:
    """Join recordings, whole or damaged, into one compact file, which appears only when it is complete.

    ``target`` may be one of the sources. Parts become one recording where each later one ``continues`` the first.
    Raises ``OSError`` where a file cannot be read or written, ``ValueError`` where nothing can be rescued of a source.
    """
    losses, damage, messages = Losses(), Damage(), 0
    with tempfile.TemporaryDirectory(prefix=".repair-", dir=target.parent) as folder:
        whole = []
        for i, source in enumerate(sources):
            of_source, copy = Damage(), Path(folder) / f"whole{i}.rrd"
            found = _copy_whole(source, None, of_source, losses)
            is_damaged = bool(of_source) or of_source.cut > 0
            if found.stores == 0 or (is_damaged and not found.rows):
                raise ValueError(f"{source}: not a Rerun recording, or nothing of it can be rescued")
            if is_damaged:
                with copy.open("wb") as file:
                    _copy_whole(source, file, Damage(), Losses())
            whole.append(copy if is_damaged else source)
            damage.join(of_source)
            messages += found.rows
        made = Path(folder) / "made.rrd"
        problem = _optimize(whole, made)
        if not problem and damage and _count(made) != messages:
            problem = "rerun rrd optimize left messages out"
        if problem and len(whole) == 1 and whole[0] != sources[0]:
            made = whole[0]  # whole, and as large as it was
        elif problem:
            raise ValueError(f"{', '.join(map(str, sources))}: cannot be repaired: {problem}")
        os.replace(made, target)
    return Repaired(damage, losses.found(), messages)


class _Copied(NamedTuple):
    stores: int
    rows: int


def _copy_whole(source: Path, file: BinaryIO | None, damage: Damage, losses: Losses) -> _Copied:
    """Write what is whole of a recording, or only look at it; the number of its stores and of its raw rows."""
    stores, main = _stores(source)
    named: set[bytes] = set()
    rows = 0
    if file is not None:
        file.write(HEADER)
    for frame in frames(source):
        if isinstance(frame, Hole):
            damage.add_hole(frame, source)
            continue
        if frame.kind == END:
            continue
        store = store_of(frame)
        is_known = store in stores
        if not is_known and frame.kind != ARROW:
            damage.add_chunk(source)
            continue
        store = store if is_known else main  # its name is damaged; its raw rows may be whole
        if file is not None and store not in named and frame.kind != STORE:
            new_store(store).write(file)  # the message that said so is damaged
        named.add(store)
        if frame.kind == ARROW:
            rows += _copy_chunk(frame, source, file, damage, losses=losses, store=b"" if is_known else store)
        elif file is not None:
            frame.write(file)
    return _Copied(len(named - {b""}), rows)


def _copy_chunk(frame: Frame, source: Path, file: BinaryIO | None, damage: Damage, losses: Losses, store: bytes) -> int:
    """Write a chunk, or what is whole of it, into another store where one is given; the number of its raw rows."""
    try:
        entity, batch = batch_of(fields_of(frame.body).stream())
        if not entity.startswith(RAW):
            _check_drawing(batch, store)
            if file is not None:
                with_batch(frame, batch).write(file)  # Rerun is stricter than Arrow with what is compressed
            return 0
        rows, good = read_rows(entity, batch)
    except ValueError:
        damage.add_chunk(source)
        return 0
    if store or not good.all():
        damage.add_chunk(source, rows=int((~good).sum()))
    if good.any() and file is not None:
        with_batch(frame, _raw_chunk(rows).to_record_batch(), store).write(file)
    losses.add(rows.numbers, rows.steps)
    return int(good.sum())


def _raw_chunk(rows: Rows) -> Chunk:
    """The rows as a new chunk: nothing is left of names and identifiers that may be damaged."""
    entity = rows.entity if rows.is_refused else entity_of(rows.keys[0])
    moments = [Moment(int(step), arrival) for step, arrival in zip(rows.steps, rows.arrivals, strict=True)]
    times = [wall_column(rows.arrivals)] if rows.is_refused else step_columns(moments)
    columns = raw_columns(rows.keys, rows.arrivals, rows.numbers.tolist(), rows.payloads, has_checksums=rows.is_checked)
    return Chunk.from_columns(entity, times, columns)


def _check_drawing(batch: pa.RecordBatch, store: bytes) -> None:
    """Raises ``ValueError`` where Rerun takes these rows for no chunk, or for another one, or of another store."""
    if store:
        raise ValueError("the name of the store is damaged")
    check_texts(batch.schema.metadata or {}, list(batch.schema))
    for field in batch.schema:
        module, _, kind = (field.metadata or {}).get(b"rerun:archetype", b"").decode().rpartition(".")
        if module.startswith("rerun.") and not hasattr(KINDS.get(module), kind):
            raise ValueError(f"{module}.{kind} is nothing that is drawn")
    name = (batch.schema.metadata or {}).get(b"rerun:id", b"").decode()
    try:
        chunks = Chunk.from_record_batch(batch)
    except (RuntimeError, TypeError, pa.ArrowException) as error:  # names in it may be no text
        raise ValueError(str(error)) from None
    if len(chunks) != 1 or not name.lower().endswith(str(chunks[0].id).removeprefix("chunk_").lower()):
        raise ValueError(f"{name} is no chunk")


def _stores(source: Path) -> tuple[set[bytes], bytes]:
    """Stores that several messages name, and the recording among them.

    A store that is named once is another one whose name is damaged.
    """
    counts = Counter(store_of(frame) for frame in frames(source) if isinstance(frame, Frame) and frame.kind != END)
    stores = {store for store, count in counts.items() if store and count > 1}
    recordings = [store for store, _ in counts.most_common() if store in stores and store.startswith(RECORDING_STORE)]
    return stores, recordings[0] if recordings else b""


def _count(path: Path) -> int:
    return sum(len(rows.keys) for rows in raw_rows(path, Damage()))


def _optimize(sources: Sequence[Path], made: Path) -> str:
    """Compact files into one; what went wrong, "" where nothing did."""
    command = [str(Path(sys.executable).with_name("rerun")), "rrd", "optimize", *map(str, sources), "-o", str(made)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=quiet_environment())
    return "" if done.returncode == 0 and made.is_file() else done.stderr.strip()[-500:] or "rerun rrd optimize failed"
