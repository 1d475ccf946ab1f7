"""The layout of a text: encoding, delimiter, header, and the lines above it."""

from __future__ import annotations

import csv
import difflib
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from lsu_mesh.mesh.data_files.problems import FileProblems, shown
from lsu_mesh.mesh.data_files.settings import DataFileSettings

DELIMITERS = (",", ";", "\t")
MAX_LINES_ABOVE = 100
"""Lines that may stand above the header."""
_BOM = b"\xef\xbb\xbf"
_NAMES = {",": "comma", ";": "semicolon", "\t": "tab", " ": "space", "|": "bar"}


@dataclass(frozen=True)
class Layout:
    """Where the header stands, and what separates the cells."""

    names: tuple[str, ...]
    delimiter: str
    header_line: int
    """From 1."""
    body: int
    """Offset of the first byte below the header."""
    notes: tuple[str, ...]


def check_text(data: bytes, problems: FileProblems, *, whole: bool) -> bytes:
    """The text in UTF-8 with line feeds only; of a cut head (``not whole``) the last line is left out.

    Raises :class:`DataFileError` for other encodings and for bytes that no text has.
    """
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise problems.fail("is UTF-16 text; save it as UTF-8: iconv -f UTF-16 -t UTF-8 FILE > NEW")
    data = data.removeprefix(_BOM)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if not whole:
        data = data[: data.rfind(b"\n") + 1]
    zero = data.find(b"\0")
    if zero >= 0:
        raise problems.fail("holds a zero byte; this is no text, or it was damaged", f"line {_line_of(data, zero)}")
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        byte = data[error.start]
        raise problems.fail(
            f"byte 0x{byte:02x} ({shown(bytes([byte]).decode('latin-1'))} in Latin-1) is not UTF-8; "
            "if the text is Latin-1: iconv -f LATIN1 -t UTF-8 FILE > NEW",
            f"line {_line_of(data, error.start)}",
        ) from None
    return data


def _line_of(data: bytes, offset: int) -> int:
    return data.count(b"\n", 0, offset) + 1


def find_layout(data: bytes, settings: DataFileSettings, problems: FileProblems) -> Layout:
    """The first line that holds all wanted columns is the header. Raises :class:`DataFileError`."""
    lines = _head_lines(data, settings.comment)
    if not lines:
        raise problems.fail("holds no rows below the header" if data.strip() else "is empty")
    delimiters: tuple[str, ...] = DELIMITERS if settings.delimiter is None else (settings.delimiter,)
    if settings.delimiter is None and settings.decimal == ",":
        delimiters = (*DELIMITERS[1:], ",")
    for number, start, text in lines:
        for delimiter in delimiters:
            names = _cells(text, delimiter)
            if set(settings.wanted) <= set(names) and (settings.columns or len(names) > 1):
                return _layout(
                    data,
                    (number, start, text),
                    names,
                    delimiter=delimiter,
                    lines=lines,
                    settings=settings,
                    problems=problems,
                )
    raise _no_header(data, lines[0], delimiters, settings=settings, problems=problems)


def guess_names(data: bytes, settings: DataFileSettings, problems: FileProblems) -> tuple[str, ...]:
    """The cells of the first line that has as many as the line below it, at least two, and no number among them."""
    lines = [text for _, _, text in _head_lines(data, settings.comment)]
    for above, below in itertools.pairwise(lines):
        for delimiter in DELIMITERS:
            names = _cells(above, delimiter)
            if 1 < len(names) == len(_cells(below, delimiter)) and not any(_is_numeric(name) for name in names):
                return tuple(names)
    raise problems.fail("no line looks like a header: names of columns, with as many cells as the rows below it")


def _layout(
    data: bytes, line: tuple[int, int, str], names: list[str], delimiter: str, lines: list[tuple[int, int, str]],
    settings: DataFileSettings, problems: FileProblems,
) -> Layout:  # fmt: skip
    number, start, _ = line
    asked = settings.wanted if settings.columns else names
    for name in dict.fromkeys(asked):
        if names.count(name) > 1:
            at = [i + 1 for i, other in enumerate(names) if other == name]
            text = f"columns {' and '.join(map(str, at))} are both called {name!r}; rename one of them"
            problems.add(f"twin {name}", f"line {number}", text)
    problems.raise_if_any()
    notes = []
    if settings.delimiter is None and delimiter != ",":
        notes.append(f"cells are separated by a {_NAMES[delimiter]}")
    above = sum(other < number for other, _, _ in lines)
    if above:
        notes.append(f"the header is line {number}; {above} line{'s' if above > 1 else ''} above it skipped")
    end = data.find(b"\n", start)
    return Layout(
        names=tuple(names),
        delimiter=delimiter,
        header_line=number,
        body=len(data) if end < 0 else end + 1,
        notes=tuple(notes),
    )


def _head_lines(data: bytes, comment: str) -> list[tuple[int, int, str]]:
    """Number, offset and text of the first lines that are neither empty nor comments."""
    found: list[tuple[int, int, str]] = []
    start, number = 0, 1
    while start < len(data) and len(found) <= MAX_LINES_ABOVE and number <= 10 * MAX_LINES_ABOVE:
        end = data.find(b"\n", start)
        end = len(data) if end < 0 else end
        line = data[start : min(end, start + csv.field_size_limit())].decode("utf-8", "replace")
        if line.strip() and not (comment and line.lstrip().startswith(comment)):
            found.append((number, start, line))
        start, number = end + 1, number + 1
    return found


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    except csv.Error:
        return []


def _no_header(
    data: bytes, first: tuple[int, int, str], delimiters: Sequence[str], settings: DataFileSettings,
    problems: FileProblems,
) -> Exception:  # fmt: skip
    """No line holds all wanted columns: each that is missing, and the likely reason."""
    number, _, text = first
    names = max((_cells(text, delimiter) for delimiter in delimiters), key=len)
    for name in settings.wanted:
        if name not in names:
            found = f"there is no column {name!r}; the columns are {', '.join(names) or 'none'}"
            problems.add(f"column {name}", f"line {number}", found + _remedy(name, names, data, settings))
    if not problems.lines():
        only = f"{settings.index!r} is the only column; expected a column of values beside it"
        problems.add("one column", f"line {number}", only)
    try:
        problems.raise_if_any()
    except Exception as error:
        return error
    raise AssertionError("a file without a header has a mistake")


def _remedy(name: str, names: Sequence[str], data: bytes, settings: DataFileSettings) -> str:
    if settings.comment:
        for number, line in enumerate(data[:65536].split(b"\n", 200)[:200], start=1):
            text = line.decode("utf-8", "replace").strip()
            if text.startswith(settings.comment) and name in text:
                return f"; line {number} names it, but begins with {settings.comment!r}: remove that mark"
    if names and all(_is_numeric(cell) for cell in names):
        return "; these are numbers, so the file has no header: write one"
    close = difflib.get_close_matches(name.lower(), [other.lower() for other in names], n=1, cutoff=0.6)
    if close:
        return f"; did you mean {next(other for other in names if other.lower() == close[0])!r}?"
    return ""


def _is_numeric(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
