"""Opening a file of data: a regular file of a known kind and a bearable size, or a reason at once."""

from __future__ import annotations

import os
import stat
from enum import Enum
from pathlib import Path

from lsu_mesh.mesh.data_files.problems import FileProblems

HEAD_BYTES = 2**18
"""So much of a text is read to find its header."""
_SPECIAL = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe (FIFO)"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)
_OTHER_KINDS = (
    (b"\x1f\x8b", "compressed by gzip; unpack it: gunzip FILE"),
    (b"BZh", "compressed by bzip2; unpack it: bunzip2 FILE"),
    (b"\xfd7zXZ", "compressed by xz; unpack it: unxz FILE"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd; unpack it: unzstd FILE"),
    (b"\x89HDF", "an HDF5 (or MATLAB 7.3) file; save the columns as CSV, Parquet or .npz"),
    (b"MATLAB 5.0", "a MATLAB file; save the columns as CSV: writetable(…)"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook; export the sheet as CSV"),
    (b"SQLite format 3", "an SQLite database; export the table as CSV"),
    (b"%PDF", "a PDF; the data are needed as CSV, Parquet or .npz"),
    (b"RRF2", "a recording of Rerun; give it to lsu-mesh replay, or export it as CSV"),
)


class FileKind(Enum):
    """How a file is read."""

    TEXT = "text"
    PARQUET = "Parquet"
    NPZ = "npz"
    NPY = "npy"


def kind_of(path: Path, max_bytes: int, problems: FileProblems) -> FileKind:
    """The kind of a file by its first bytes.

    Raises :class:`DataFileError` for what is no regular file, is too large, or is of a kind that cannot be played.
    """
    try:
        found = path.stat()
    except (OSError, ValueError) as error:
        raise problems.fail(f"cannot be read: {_reason(error)}") from None
    for is_so, word in _SPECIAL:
        if is_so(found.st_mode):
            raise problems.fail(f"is {word}; expected a file of CSV, Parquet or NumPy data")
    if found.st_size > max_bytes:
        raise problems.fail(
            f"holds {_size(found.st_size)}, at most {_size(max_bytes)} are read; split it, or keep fewer rows"
        )
    head = read_bytes(path, 32, problems)
    for magic, words in _OTHER_KINDS:
        if head.startswith(magic):
            raise problems.fail(f"is {words}")
    if head.startswith(b"PAR1"):
        return FileKind.PARQUET
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return FileKind.NPZ
    return FileKind.NPY if head.startswith(b"\x93NUMPY") else FileKind.TEXT


def read_bytes(path: Path, most: int, problems: FileProblems) -> bytes:
    """The first ``most`` bytes. A file that was swapped for a pipe meanwhile does not block."""
    try:
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            return file.read(most)
    except (OSError, ValueError) as error:
        raise problems.fail(f"cannot be read: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def _size(count: int) -> str:
    return f"{count / 2**20:.0f} MiB" if count >= 2**20 else f"{count} bytes"
