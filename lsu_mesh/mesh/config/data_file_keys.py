"""The keys of a table that say how its file is written: delimiter, decimal, comment, missing, time_unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

from lsu_mesh.mesh.data_files.settings import MISSING_WORDS, TIME_UNITS

if TYPE_CHECKING:
    from lsu_mesh.mesh.config.table import Table

KEYS = ("delimiter", "decimal", "comment", "missing", "time_unit")
DELIMITERS = (",", ";", "\t", "|", ":", " ")


class FileFormat(TypedDict):
    """Those fields of :class:`lsu_mesh.mesh.data_files.DataFileSettings`."""

    delimiter: str | None
    decimal: str
    comment: str
    missing: tuple[str, ...]
    time_unit: str | None


def read_file_format(table: Table) -> FileFormat:
    """The keys as they are given; what is not given is found in the file."""
    return FileFormat(
        delimiter=_one_of(table, "delimiter", DELIMITERS),
        decimal=table.choice("decimal", (".", ","), "."),
        comment=table.text("comment", "#"),
        missing=tuple(table.texts("missing", list(MISSING_WORDS))),
        time_unit=_one_of(table, "time_unit", tuple(TIME_UNITS)),
    )


def _one_of(table: Table, key: str, words: tuple[str, ...]) -> str | None:
    """One of the words, or None where the key is not given."""
    return table.choice(key, words, words[0]) if key in table.values else table.text(key, None)
