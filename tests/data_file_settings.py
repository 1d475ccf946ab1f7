"""Settings of a file of data, short for tests; the types of the fixtures that read one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from lsu_mesh.mesh.data_files import DataFile, DataFileSettings

ReadText = Callable[..., DataFile]
Refusals = Callable[..., list[str]]


def settings_of(path: Path, **options: Any) -> DataFileSettings:
    """A file by time ``t``, or by ``step`` if that is asked for."""
    index, columns = options.pop("index", "t"), options.pop("columns", ())
    indexed_by = options.pop("indexed_by", "step" if index == "step" else "time")
    return DataFileSettings(path, tuple(columns), index, indexed_by, **options)
