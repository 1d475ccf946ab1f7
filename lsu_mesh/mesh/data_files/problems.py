"""What is wrong with a file of data: one line for each kind of mistake, with the first place and the count."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lsu_mesh.errors import LsuMeshError

MAX_SHOWN = 40
"""Characters of a cell that a message shows."""


class DataFileError(LsuMeshError):
    """A file of data is wrong; each of ``lines`` says file, line, column, value and remedy."""

    def __init__(self, lines: Sequence[str]) -> None:
        super().__init__("\n".join(lines))
        self.lines = list(lines)


class FileProblems:
    """Collects the mistakes of one file: the first of each kind, and how many there are."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._first: dict[str, tuple[str, str]] = {}
        self._counts: dict[str, int] = {}

    def add(self, kind: str, place: str, text: str, *, count: int = 1, unit: str = "cells") -> None:
        """Record ``count`` mistakes of a kind; place and text of the first are shown."""
        if kind not in self._first:
            self._first[kind] = (f"{place}: {text}" if place else text, unit)
        self._counts[kind] = self._counts.get(kind, 0) + count

    def fail(self, text: str, place: str = "") -> DataFileError:
        """The error of a mistake after which nothing else can be read."""
        self.add(text, place, text)
        return DataFileError(self.lines())

    def lines(self) -> list[str]:
        """One line per kind."""
        found = []
        for kind, (text, unit) in self._first.items():
            count = self._counts[kind]
            found.append(f"{self.path}: {text}" + (f" ({count} such {unit})" if count > 1 else ""))
        return found

    def raise_if_any(self) -> None:
        """Raise :class:`DataFileError` when there was a mistake."""
        if self._first:
            raise DataFileError(self.lines())


def shown(cell: str | bytes) -> str:
    """A cell as a message shows it: quoted, short, printable."""
    text = cell.decode("utf-8", "replace") if isinstance(cell, bytes) else cell
    return repr(text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 1] + "…")


def cell_place(line: int, column: str) -> str:
    """Where a cell stands; a file without lines counts rows."""
    return f"line {line}, column {column!r}"
