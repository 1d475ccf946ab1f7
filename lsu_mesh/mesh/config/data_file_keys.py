"""The keys of a table that say how its file is written: delimiter, decimal, comment, missing, time_unit."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

from lsu_mesh.mesh.data_files.settings import MISSING_WORDS, TIME_UNITS

if TYPE_CHECKING:
    from lsu_mesh.mesh.config.table import Table

KEYS = ("delimiter", "decimal", "comment", "missing", "time_unit")


class FileFormat(TypedDict):
    """Those fields of :class:`lsu_mesh.mesh.data_files.DataFileSettings`."""

    delimiter: str | None
    decimal: str
    comment: str
    missing: tuple[str, ...]
    time_unit: str | None


def read_file_format(table: Table) -> FileFormat:
    """The keys as they are given; what is not given is found in the file."""
    delimiter = table.text("delimiter", None)
    if delimiter is not None and (len(delimiter) != 1 or delimiter in '"\r\n' or not delimiter.isascii()):
        table.wrong("delimiter", f'expected one character such as ";" or "\\t", found {delimiter!r}')
        delimiter = None
    decimal = table.choice("decimal", (".", ","), ".")
    comment = table.read("comment", "#", "a string", lambda v: v if isinstance(v, str) and "\n" not in v else None)
    missing = table.texts("missing", list(MISSING_WORDS))
    time_unit = table.choice("time_unit", tuple(TIME_UNITS), "s") if "time_unit" in table.values else None
    if "time_unit" not in table.values:
        table.read("time_unit", None, "a unit", lambda v: v)  # so that the key is known
    return FileFormat(
        delimiter=delimiter, decimal=decimal, comment=comment, missing=tuple(missing), time_unit=time_unit
    )  # fmt: skip
