"""The rows of a text as columns of cells: at once where every row is regular, line by line where not."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lsu_mesh.array_types import CellTexts, Flags, Integers, RawBytes
from lsu_mesh.mesh.data_files.layout import Layout
from lsu_mesh.mesh.data_files.problems import FileProblems
from lsu_mesh.mesh.data_files.settings import DataFileSettings

MAX_CELL = 80
"""A longer cell is no number and no time; it is cut to one byte more."""
_BLOCK = 8192
_NEWLINE, _QUOTE = 10, 34


@dataclass(frozen=True)
class Cells:
    """``columns[name]`` (T,): the cells as bytes, without spaces around them."""

    columns: Mapping[str, CellTexts]
    lines: Integers
    blank: int
    """Rows of nothing but delimiters, left out."""
    ends_open: bool
    """The last line has no line end, so that it may be cut off."""


def split_rows(
    data: bytes, layout: Layout, names: Sequence[str], settings: DataFileSettings, problems: FileProblems
) -> Cells:
    """The cells of the named columns. Rows that are wider or shorter than the header are recorded in ``problems``."""
    body = data[layout.body :]
    open_end = bool(body) and not body.endswith(b"\n")
    text = body + b"\n" if open_end else body
    at = [layout.names.index(name) for name in names]
    found = _regular(text, layout, at, settings.comment)
    if found is None:
        found = _irregular(text, layout, at, settings=settings, problems=problems, open_end=open_end)
    columns, lines, blank = found
    return Cells(dict(zip(names, columns, strict=True)), lines, blank, open_end)


def _regular(
    text: bytes, layout: Layout, at: Sequence[int], comment: str
) -> tuple[list[CellTexts], Integers, int] | None:
    """None unless every line has one cell per column, without quotes and comments."""
    count = len(layout.names)
    delimiter = layout.delimiter.encode()
    if count < 2 or len(delimiter) != 1 or (comment and _has_comments(text, comment.encode())):
        return None
    data = np.frombuffer(text, dtype=np.uint8)
    if b'"' in text:
        unquoted = _without_quotes(data, delimiter[0])
        if unquoted is None:
            return None
        data = unquoted
    separators = np.flatnonzero((data == delimiter[0]) | (data == _NEWLINE))
    if not len(separators) or len(separators) % count:
        return None
    ends = separators.reshape(-1, count)
    is_newline = data[ends] == _NEWLINE
    if not is_newline[:, -1].all() or is_newline[:, :-1].any():
        return None
    starts = np.empty_like(ends)
    starts[:, 1:] = ends[:, :-1] + 1
    starts[0, 0], starts[1:, 0] = 0, ends[:-1, -1] + 1
    lines = np.arange(len(ends), dtype=np.int64) + layout.header_line + 1
    filled = ends[:, -1] - starts[:, 0] > count - 1
    if not filled.all():
        starts, ends, lines = starts[filled], ends[filled], lines[filled]
    return [_cut(data, starts[:, i], ends[:, i]) for i in at], lines, int((~filled).sum())


def _has_comments(text: bytes, comment: bytes) -> bool:
    """Whether a line begins with the mark, after blanks."""
    return comment in text and re.search(rb"(?:^|\n)[ \t]*" + re.escape(comment), text) is not None


def _without_quotes(data: RawBytes, delimiter: int) -> RawBytes | None:
    """The text without its quotes, where they do nothing: each pair encloses a whole cell, without a separator."""
    is_quote = data == _QUOTE
    at = np.flatnonzero(is_quote)
    if len(at) % 2:
        return None
    separator = np.concatenate([[True], (data == delimiter) | (data == _NEWLINE)])  # shifted by one, with the start
    opening, closing = at[::2], at[1::2]
    if not separator[opening].all() or not separator[np.minimum(closing + 2, len(data))].all():
        return None
    separators = np.flatnonzero(separator[1:])
    encloses = np.searchsorted(separators, opening) != np.searchsorted(separators, closing)
    return None if encloses.any() else data[~is_quote]


def _cut(data: RawBytes, starts: Integers, ends: Integers) -> CellTexts:
    """The bytes from each start to its end, at most ``MAX_CELL + 1``, block by block to stay in the cache."""
    lengths = np.minimum(ends - starts, MAX_CELL + 1).astype(np.uint8)
    width = max(int(lengths.max(initial=0)), 1)
    windows = np.lib.stride_tricks.sliding_window_view(np.concatenate([data, np.zeros(width, dtype=np.uint8)]), width)
    cut = np.empty((len(starts), width), dtype=np.uint8)
    offsets = np.arange(width, dtype=np.uint8)
    for first in range(0, len(starts), _BLOCK):
        rows = slice(first, first + _BLOCK)
        np.multiply(windows[starts[rows]], offsets < lengths[rows, None], out=cut[rows])
    cells: CellTexts = cut.view(f"S{width}").ravel()
    if not ((cut == 32) | (cut == 9)).any():
        return cells
    is_cut = lengths > MAX_CELL  # keeps its blanks: it must stay too long
    return np.where(is_cut, cells, np.strings.strip(cells))


def is_too_long(cells: CellTexts) -> Flags:
    """Which cells were cut, so that nothing may be read from them."""
    return np.strings.str_len(cells) > MAX_CELL


def _irregular(
    text: bytes, layout: Layout, at: Sequence[int], settings: DataFileSettings, problems: FileProblems, open_end: bool
) -> tuple[list[CellTexts], Integers, int]:
    source = _Lines(text, layout.header_line, settings.comment)
    reader = csv.reader(source, delimiter=layout.delimiter, strict=True)
    rows: list[list[str]] = []
    lines: list[int] = []
    blank, count, last = 0, len(layout.names), text.count(b"\n") + layout.header_line
    try:
        for row in reader:
            if not row or (len(row) == 1 and not row[0].strip()):
                continue
            if not any(cell.strip() for cell in row):
                blank += 1
            elif len(row) == count:
                rows.append(row)
                lines.append(source.line)
            else:
                _wrong_width(row, source.line, layout, problems, is_cut=open_end and source.line == last)
    except csv.Error as error:
        problems.add("quotes", f"line {source.line}", f"a quote is not closed, or stands inside a cell: {error}")
    columns = [_column([row[i] for row in rows]) for i in at]
    return columns, np.array(lines, dtype=np.int64), blank


def _column(cells: list[str]) -> CellTexts:
    return np.array([cell.strip().encode()[: MAX_CELL + 1] for cell in cells], dtype=np.bytes_).reshape(len(cells))


class _Lines:
    """The lines of a text without its comments; ``line`` is the number of the last one given."""

    def __init__(self, text: bytes, header_line: int, comment: str) -> None:
        self._lines = text.decode("utf-8").split("\n")[:-1]
        self._comment = comment
        self._first = header_line + 1
        self.line = header_line

    def __iter__(self) -> Iterator[str]:
        for number, line in enumerate(self._lines, start=self._first):
            self.line = number
            if not (self._comment and line.lstrip().startswith(self._comment)):
                yield line + "\n"


def _wrong_width(row: list[str], line: int, layout: Layout, problems: FileProblems, *, is_cut: bool) -> None:
    count = len(layout.names)
    has = f"{len(row)} cell{'s' if len(row) != 1 else ''}, the header has {count}"
    if is_cut:
        text = f"the last line is cut off: {has}, and no line end follows; copy the file again, or remove the line"
        problems.add("cut", f"line {line}", text, unit="rows")
    elif len(row) < count:
        text = f"{has}; write every cell, an empty one for a missing value"
        problems.add("short", f"line {line}", text, unit="rows")
    elif len(row) == count + 1 and not row[-1].strip():
        text = f"the row ends with a {layout.delimiter!r} that the header does not have; remove it"
        problems.add("wide by one", f"line {line}", text, unit="rows")
    else:
        text = f"{has}; {_why_wide(layout.delimiter)}"
        problems.add("wide", f"line {line}", text, unit="rows")


def _why_wide(delimiter: str) -> str:
    if delimiter == ",":
        return 'a decimal comma, as in 1,5, splits a number: write 1.5, or "1,5" in quotes with decimal = ","'
    return f"a text that holds {delimiter!r} needs quotes"
