"""A mistake of a configuration, as a record: where it is, what was found, what was expected."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lsu_mesh.errors import LsuMeshError


@dataclass(frozen=True)
class Problem:
    """One mistake, or one doubt; ``str()`` is the line for people.

    ``table`` is like ``filters.cz``, empty for the file as a whole; ``key`` is empty where the table itself is meant.
    ``found`` is the value as TOML text, ``expected`` says in words what it should be, ``nearest`` is the valid name
    that is closest. ``line`` counts from 1. ``source`` is the flag or variable that the value came from.
    """

    file: str
    table: str
    key: str
    text: str
    expected: str
    found: str | None = None
    nearest: str | None = None
    line: int | None = None
    source: str = ""
    is_warning: bool = False

    def __str__(self) -> str:
        line = "" if self.line is None else f"line {self.line}: "
        source = f" (from {self.source})" if self.source else ""
        return f"{self.file}: {line}{'warning: ' if self.is_warning else ''}{self.sentence}{source}"

    @property
    def path(self) -> str:
        """Table and key, like ``filters.cz.kind``."""
        return f"{self.table}.{self.key}".strip(".")

    @property
    def sentence(self) -> str:
        """Place and text, without the file."""
        place = " ".join(part for part in (f"[{self.table}]" if self.table else "", self.key) if part)
        return f"{place}: {self.text}" if place else self.text

    def as_record(self) -> dict[str, Any]:
        """The fields for a line of JSON; ``level`` is ``"mistake"`` or ``"warning"``."""
        fields = asdict(self)
        level = "warning" if fields.pop("is_warning") else "mistake"
        return {"level": level, **fields, "source": self.source or None}


@dataclass(frozen=True)
class DataProblem(Problem):
    """A mistake in a file of measurements that a table names; ``words`` is its line for people."""

    words: str = ""

    def __str__(self) -> str:
        return self.words

    def as_record(self) -> dict[str, Any]:
        """As :meth:`Problem.as_record`; ``file`` and ``line`` are those of the measurements."""
        fields = super().as_record()
        del fields["words"]
        return fields


def data_problem(table: str, path: Path, words: str) -> DataProblem:
    """A line about a file of measurements; it begins with the file and, where there is one, the line of the file."""
    text = words.removeprefix(f"{path}: ")
    place = re.match(r"line ([0-9]+)", text)
    asked = re.search(r"expected (.+?), found ('(?:[^'])*'|[^;]+)", text)
    expected, found = (asked[1], asked[2]) if asked else ("a file of data with the columns that the table names", None)
    line = int(place[1]) if place else None
    return DataProblem(
        file=str(path), table=table, key="file", text=text, expected=expected, found=found, line=line, words=words
    )


def data_doubt(table: str, path: Path, text: str) -> DataProblem:
    """What is doubtful about a file of measurements as a whole."""
    words, expected = f"{path}: warning: {text}", "a file of which every row is used at its own moment"
    return DataProblem(
        file=str(path), table=table, key="file", text=text, expected=expected, is_warning=True, words=words
    )


class ConfigurationError(LsuMeshError):
    """A configuration is wrong.

    Attributes
    ----------
    records:
        One :class:`Problem` per mistake.
    problems:
        One line per mistake.
    """

    def __init__(self, records: Sequence[Problem]) -> None:
        self.records = tuple(records)
        self.problems = tuple(str(record) for record in records)
        super().__init__("\n".join(self.problems))


class Problems:
    """The mistakes found so far, and the keys that were asked for.

    ``lines`` holds the line of each ``table.key`` of the file, ``sources`` the flag or variable that gave a value.
    """

    def __init__(
        self,
        file: str,
        *,
        reads_files: bool = True,
        makes_filters: bool = True,
        lines: Mapping[str, int] | None = None,
    ) -> None:
        self.file = file
        self.reads_files = reads_files
        """Whether files of measurements are looked into; of a recorded configuration they may be gone."""
        self.makes_filters = makes_filters
        """Whether each filter is made once, so that its class checks its options, which loads kernels."""
        self.lines = dict(lines or {})
        self.sources: dict[str, str] = {}
        self.records: list[Problem] = []
        self.asked: set[str] = set()

    def add(self, table: str, key: str, text: str, *, expected: str = "", **more: Any) -> None:
        """Note a mistake; the line and the source are looked up."""
        self.records.append(
            self.placed(Problem(file=self.file, table=table, key=key, text=text, expected=expected or text, **more))
        )

    def placed(self, problem: Problem) -> Problem:
        """The same with its line, or with the flag or variable that the value came from."""
        path = problem.path
        source = self._source(path)
        if source:
            return replace(problem, source=source)
        line = self.lines.get(path) if problem.key else None
        return replace(problem, line=line if line is not None else self.lines.get(problem.table))

    def _source(self, path: str) -> str:
        """The flag or variable that set ``path``, a table around it, or, where the file has no such key, a part."""
        around = [given for given in self.sources if path == given or path.startswith((f"{given}.", f"{given}["))]
        if around:
            return self.sources[max(around, key=len)]
        within = [given for given in self.sources if given.startswith(f"{path}.")] if path not in self.lines else []
        return self.sources[within[-1]] if within and path else ""

    def are_in(self, table: str, *keys: str) -> bool:
        """Whether a mistake at this table or inside of it, or at these keys of it if any are named, was noted."""
        places = tuple(f"{table}.{key}" for key in keys) or (table,)
        return any(one.path == at or one.path.startswith((f"{at}.", f"{at}[")) for one in self.records for at in places)

    def raise_if_any(self) -> None:
        """Raise :class:`ConfigurationError` when there was a mistake."""
        if self.records:
            raise ConfigurationError(self.records)


def closest(word: str, known: Iterable[str]) -> str | None:
    """The known word that is nearest, if one is near."""
    close = difflib.get_close_matches(word, sorted(known), n=1, cutoff=0.5)
    return close[0] if close else None


def nearest(word: str, known: Iterable[str]) -> str:
    """``did you mean "x"?`` for the closest known word, else the list of them."""
    words = sorted(known)
    close = closest(word, words)
    if close is not None:
        return f'did you mean "{close}"?'
    return f"known here: {', '.join(words)}" if words else "none is known here"
