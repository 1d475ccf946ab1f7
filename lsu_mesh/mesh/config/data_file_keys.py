"""The keys of a table that say how its file is written: delimiter, decimal, comment, missing, time_unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

from lsu_mesh.mesh.config.expected import Expected, Unfit, choice
from lsu_mesh.mesh.data_files.settings import MISSING_WORDS, TIME_UNITS

if TYPE_CHECKING:
    from lsu_mesh.mesh.config.table import Table

_FOUND: str | None = None
"""It is found in the file."""
KEYS = ("delimiter", "decimal", "comment", "missing", "time_unit")
_DELIMITERS = choice((",", ";", "\t", "|", ":", " "))


class FileFormat(TypedDict):
    """Those fields of :class:`lsu_mesh.mesh.data_files.DataFileSettings`."""

    delimiter: str | None
    decimal: str
    comment: str
    missing: tuple[str, ...]
    time_unit: str | None


def read_file_format(table: Table) -> FileFormat:
    """The keys as they are given; what is not given is found in the file."""
    delimiter: str | None = table.read(
        "delimiter", _FOUND, Expected[str | None](_DELIMITERS.words, _DELIMITERS.convert)
    )
    decimal = table.choice("decimal", (".", ","), ".")
    comment = table.read("comment", "#", Expected("the text that begins a comment", _as_comment))
    missing = table.texts("missing", list(MISSING_WORDS))
    units = choice(tuple(TIME_UNITS))
    time_unit = table.read("time_unit", _FOUND, Expected[str | None](units.words, units.convert))
    return FileFormat(
        delimiter=delimiter, decimal=decimal, comment=comment, missing=tuple(missing), time_unit=time_unit
    )  # fmt: skip


def _as_comment(value: object) -> str:
    if not isinstance(value, str) or "\n" in value:
        raise Unfit
    return value
