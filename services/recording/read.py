"""Reading raw payloads back, bit by bit, also from a recording whose writer was killed."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
from rerun.chunk import RrdReader

from services.recording.mend import mend
from services.recording.raw import ARCHETYPE, REFUSED


class RawMessage(NamedTuple):
    """One message as the recorder received it."""

    key: str
    arrival_ns: int
    payload: bytes


def read_raw(path: Path, *, refused: bool = False) -> list[RawMessage]:
    """The accepted messages of a recording in the order of arrival; ``refused=True``: all payloads, also those refused.

    Raises ``FileNotFoundError``, or ``ValueError`` where the file is no recording.
    """
    if not path.is_file():
        raise FileNotFoundError(2, "no such recording", str(path))
    try:
        rows = _read(path, refused)
    except RuntimeError:  # a message is cut short: what is whole is read from a mended copy
        with tempfile.TemporaryDirectory(prefix="read-") as folder:
            copy = Path(folder) / "mended.rrd"
            mend([path], copy)
            rows = _read(copy, refused)
    rows.sort(key=lambda row: row[0])
    return [message for _, message in rows]


def _read(path: Path, refused: bool) -> list[tuple[int, RawMessage]]:
    with warnings.catch_warnings():
        # A recording that is still written, or whose writer was killed, has no footer.
        warnings.filterwarnings("ignore", message="RRD file has no footer")
        chunks = RrdReader(path).stream().filter(content="/raw/**")
    return [
        row for chunk in chunks if refused or chunk.entity_path != REFUSED for row in _rows(chunk.to_record_batch())
    ]


def _rows(batch: pa.RecordBatch) -> list[tuple[int, RawMessage]]:
    values = {name: _flat(batch.column(f"{ARCHETYPE}:{name}")) for name in ("number", "key", "arrival_ns", "payload")}
    return [
        (number, RawMessage(key, arrival, payload))
        for number, key, arrival, payload in zip(
            values["number"], values["key"], values["arrival_ns"], values["payload"], strict=True
        )
    ]


def _flat(column: pa.Array) -> list[Any]:
    return list(column.flatten().to_pylist())
