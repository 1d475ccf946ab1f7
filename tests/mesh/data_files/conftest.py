"""Files of data made for one test."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from data_file_settings import ReadText, Refusals, settings_of

from lsu_mesh.mesh.data_files import DataFile, DataFileError, read


@pytest.fixture
def read_text(tmp_path: Path) -> ReadText:
    """Write a text, and read it."""

    def make(text: str | bytes, **options: Any) -> DataFile:
        path = tmp_path / "data.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read(settings_of(path, **options))

    return make


@pytest.fixture
def refusals(tmp_path: Path, read_text: ReadText) -> Refusals:
    """The lines of the error, without the folder; a file that is read is a failure."""

    def make(text: str | bytes, **options: Any) -> list[str]:
        with pytest.raises(DataFileError) as caught:
            read_text(text, **options)
        return [line.replace(f"{tmp_path}/", "") for line in caught.value.lines]

    return make
