"""Columns of cells as numbers; anything that is neither a number nor a word for "missing" is a mistake."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import CellTexts, Flags, Integers, Vector
from lsu_mesh.mesh.data_files.cells import MAX_CELL, is_too_long
from lsu_mesh.mesh.data_files.problems import FileProblems, cell_place, shown
from lsu_mesh.mesh.data_files.settings import DataFileSettings

MAX_STEP = 2**53
_NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def bytes_of(cells: CellTexts) -> NDArray[np.uint8]:
    """(T, width): the bytes of each cell, zeros behind its end."""
    return np.ascontiguousarray(cells).view(np.uint8).reshape(len(cells), cells.dtype.itemsize)


def with_point(
    cells: CellTexts, name: str, lines: Integers, settings: DataFileSettings, problems: FileProblems
) -> CellTexts:
    """Decimal commas as points, if the settings say so; a point then is a mistake."""
    if settings.decimal == "." or not len(cells):
        return cells
    pointed = (bytes_of(cells) == ord(".")).any(axis=1)
    if pointed.any():
        i = int(np.argmax(pointed))
        text = f'{shown(cells[i])} has a point, but decimal = ","; write numbers in one way, without thousands'
        problems.add("point", cell_place(int(lines[i]), name), text, count=int(pointed.sum()))
        cells = np.where(pointed, b"0", cells)  # one mistake is enough
    return np.strings.replace(cells, b",", b".")


def missing_cells(cells: CellTexts, settings: DataFileSettings) -> Flags:
    """Which cells are empty or hold a word for "missing"."""
    if not len(cells):
        return np.zeros(0, dtype=bool)
    characters = bytes_of(cells)
    first, second = characters[:, 0], characters[:, min(1, characters.shape[1] - 1)]
    missing: Flags = first == 0
    words = {word.strip().lower().encode() for word in settings.missing} - {b""}
    is_number_like = _is_digit(first) | (_is_sign(first) & (_is_digit(second) | (second == ord("."))))
    unsure = ~missing & ~is_number_like
    for digit in {word[0] for word in words if word[:1].isdigit()}:  # such as 9999
        unsure |= first == digit
    if any(word[:1] in (b"+", b"-", b".") and len(word) > 1 for word in words):
        unsure |= _is_sign(first)
    if unsure.any():
        lowered = np.strings.lower(cells[unsure])
        found = np.zeros(len(lowered), dtype=bool)
        for word in words:
            found |= lowered == word
        missing[unsure] = found
    return missing


def _is_digit(characters: NDArray[np.uint8]) -> Flags:
    is_digit: Flags = (characters >= ord("0")) & (characters <= ord("9"))
    return is_digit


def read_numbers(
    cells: CellTexts, name: str, lines: Integers, settings: DataFileSettings, problems: FileProblems
) -> Vector:
    """(T,) float64, NaN = missing; every decimal is rounded to the nearest double."""
    missing, written = missing_cells(cells, settings), cells
    cells = with_point(cells, name, lines, settings=settings, problems=problems)
    values, wrong = _converted(cells, ~missing)
    if wrong.any():
        _record_texts(written, name, lines, wrong=wrong, settings=settings, problems=problems)
    infinite = np.isinf(values)
    if infinite.any():
        i = int(np.argmax(infinite))
        text = f"{shown(cells[i])} is too large for a number of 64 bits"
        problems.add("huge", cell_place(int(lines[i]), name), text, count=int(infinite.sum()))
    return values


def _is_sign(characters: NDArray[np.uint8]) -> Flags:
    is_sign: Flags = (characters == ord("-")) | (characters == ord("+")) | (characters == ord("."))
    return is_sign


def _converted(cells: CellTexts, asked: Flags) -> tuple[Vector, Flags]:
    """The ``asked`` cells as numbers, NaN elsewhere, and which of them are no decimal numbers such as -1, .5, 2., 1e-3.

    NumPy takes words and underscores too, as Python does: cells with other characters are left out first.
    """
    values = np.full(len(cells), np.nan)
    wrong = np.zeros(len(cells), dtype=bool)
    if not len(cells):
        return values, wrong
    characters = bytes_of(cells)
    odd = characters > ord("9")
    if odd.any():
        wrong = asked & (odd & ((characters | 32) != ord("e"))).any(axis=1)
    if characters.shape[1] > MAX_CELL:
        wrong |= asked & is_too_long(cells)
    try:
        if asked.all() and not wrong.any():
            return _doubles(cells), wrong
        good = asked & ~wrong
        values[good] = _doubles(cells[good])
    except ValueError:
        at = np.flatnonzero(asked & ~wrong)
        wrong[at] = [_NUMBER.fullmatch(cell) is None for cell in cells[at].tolist()]
        good = asked & ~wrong
        values[good] = _doubles(cells[good])
    return values, wrong


def _doubles(cells: CellTexts) -> Vector:
    """Decimal text as the nearest doubles; what is too large for one becomes ±inf, which the caller reports."""
    with np.errstate(over="ignore"):
        return cells.astype(np.float64)


def _record_texts(
    cells: CellTexts, name: str, lines: Integers, wrong: Flags, settings: DataFileSettings, problems: FileProblems
) -> None:
    """One line per sort of wrong text."""
    at = np.flatnonzero(wrong)
    for i, cell in zip(at.tolist(), cells[at].tolist(), strict=True):
        kind, remedy = _why(cell, settings)
        text = f"expected a number or nothing (= missing), found {shown(cell)}{remedy}"
        problems.add(f"{kind} in {name}", cell_place(int(lines[i]), name), text)


def _why(cell: bytes, settings: DataFileSettings) -> tuple[str, str]:
    """The sort of a mistake, and its remedy."""
    if len(cell) > MAX_CELL:
        return "long text", ""
    if re.fullmatch(rb"[+-]?inf(inity)?", cell, re.IGNORECASE):
        return "infinity", "; leave the cell empty where there is no value"
    if re.fullmatch(rb"[+-]?\d+,\d+", cell):
        return "decimal comma", '; is this a decimal comma? Then set decimal = ","'
    if re.fullmatch(rb"[+-]?\d{1,3}(,\d{3})+(\.\d*)?", cell):
        return "thousands", "; write the number without commas"
    if b"_" in cell and _NUMBER.fullmatch(cell.replace(b"_", b"")):
        return "underscore", "; write the number without underscores"
    if cell[:1].isalpha() and len(cell) <= 12:
        return "text", f'; if it means "missing", add it: missing = [{cell.decode("utf-8", "replace")!r}, …]'.replace(
            "'", '"'
        )
    return "text", ""


def read_steps(
    cells: CellTexts, name: str, lines: Integers, settings: DataFileSettings, problems: FileProblems
) -> Integers:
    """(T,) whole numbers; 12.0 is one."""
    cells = with_point(cells, name, lines, settings=settings, problems=problems)
    values, _ = _converted(cells, np.ones(len(cells), dtype=bool))
    with np.errstate(invalid="ignore"):
        whole = (values == np.floor(values)) & (np.abs(values) <= MAX_STEP)
    if not whole.all():
        i = int(np.argmin(whole))
        text = f"expected a whole number, found {shown(cells[i])}"
        problems.add("step", cell_place(int(lines[i]), name), text, count=int((~whole).sum()))
    return np.where(whole, values, 0.0).astype(np.int64)
