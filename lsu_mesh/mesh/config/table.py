"""Reading one TOML table: typed values, defaults, and every mistake with its place and remedy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from lsu_mesh.mesh.config import expected
from lsu_mesh.mesh.config.expected import WHOLE_LIMIT, Expected, Unfit, shown
from lsu_mesh.mesh.config.problem import Problems, closest, nearest

T = TypeVar("T")
Word = TypeVar("Word", bound=str)
REQUIRED: Any = object()


class Table:
    """One table of the file. Keys that nobody asks for are unknown; :meth:`finish` says so."""

    def __init__(self, values: object, path: str, problems: Problems) -> None:
        self.path = path
        self.problems = problems
        self.is_table = isinstance(values, dict)
        self._asked: list[str] = []
        self.values: dict[str, Any] = values if isinstance(values, dict) else {}
        if not self.is_table:
            outer, _, key = path.rpartition(".")
            text = f"expected a table, found {shown(values)}"
            problems.add(outer, key, text, expected="a table", found=shown(values))

    def wrong(self, key: str, text: str, expected: str, *, found: str | None = None, near: str | None = None) -> None:
        """Note a mistake at a key of this table; ``text`` is the whole sentence."""
        if found is None and key in self.values:
            found = shown(self.values[key])
        self.problems.add(self.path, key, text, expected=expected, found=found, nearest=near)

    def mismatch(self, key: str, expected: str, found: object) -> None:
        """Note that ``expected`` is not what was found."""
        self.wrong(key, f"expected {expected}, found {found}", expected)

    def read(self, key: str, default: T, expected: Expected[T], *, is_alias: bool = False) -> T:
        """The value at ``key``, or the default where it is missing or not as expected; an alias is no own key."""
        self._asked.append(key)
        if not is_alias:
            self.problems.asked.add(f"{self.path}.{key}" if self.path else key)
        if key not in self.values:
            if default is REQUIRED and self.is_table:
                self.wrong(key, f"is missing; expected {expected.words}", expected.words)
            return default
        try:
            return expected.convert(self.values[key])
        except Unfit as unfit:
            self.wrong(key, expected.explain(self.values[key], unfit), expected.words, near=unfit.nearest)
            return default

    def text(self, key: str, default: Any = REQUIRED) -> Any:
        """A string."""
        return self.read(key, default, expected.TEXT)

    def choice(self, key: str, choices: Sequence[Word], default: Word) -> Word:
        """One of a few words."""
        found: Word = self.read(key, default, expected.choice(choices))
        return found

    def flag(self, key: str, default: bool) -> bool:
        """true or false."""
        return self.read(key, default, expected.FLAG)

    def whole(self, key: str, default: Any = REQUIRED, low: int = 0, high: int = WHOLE_LIMIT) -> Any:
        """An integer within limits."""
        return self.read(key, default, expected.whole(low, high))

    def number(self, key: str, default: Any = REQUIRED, above: float = -math.inf) -> Any:
        """A finite number, larger than ``above``."""
        return self.read(key, default, expected.number(above))

    def duration(self, key: str, default: float, low: float = 0.0) -> float:
        """A time such as "50ms" in seconds."""
        return self.read(key, default, expected.duration(low))

    def size(self, key: str, default: int) -> int:
        """A size such as "500MB" in bytes."""
        found: int = self.read(key, default, expected.SIZE)
        return found

    def vector(self, key: str, default: Any = REQUIRED) -> Any:
        """A list of finite numbers."""
        return self.read(key, default, expected.VECTOR)

    def number_or_vector(self, key: str, default: Any = REQUIRED) -> Any:
        """One number for all entries, or a list of them."""
        is_number = isinstance(self.values.get(key), int | float)
        return self.number(key, default) if is_number else self.vector(key, default)

    def span_ns(self, key: str, default: Any = 0, low: int = 0) -> Any:
        """A time such as "5ms", or a number of seconds, in whole nanoseconds."""
        return self.read(key, default, expected.span_ns(low))

    def matrix(self, key: str, default: Any = REQUIRED) -> Any:
        """A list of rows of one length."""
        return self.read(key, default, expected.MATRIX)

    def texts(self, key: str, default: Any = REQUIRED) -> Any:
        """A list of strings."""
        return self.read(key, default, expected.TEXTS)

    def tables(self, key: str) -> list[Table]:
        """A list of tables."""
        found = self.read(key, [], expected.TABLES)
        return [Table(item, f"{self.path}.{key}[{i}]", self.problems) for i, item in enumerate(found)]

    def table(self, key: str, *, required: bool = False) -> Table | None:
        """A table inside this one; ``None`` when it is not there."""
        self._asked.append(key)
        path = f"{self.path}.{key}" if self.path else key
        if key not in self.values:
            if required and self.is_table:
                self.problems.add(path, "", "this table is missing", expected=f"a table [{path}]")
            return None
        return Table(self.values[key], path, self.problems)

    def rest(self) -> dict[str, Any]:
        """The keys that nobody has asked for yet."""
        return {key: value for key, value in self.values.items() if key not in self._asked}

    def finish(self) -> None:
        """Say which keys are unknown."""
        for key in self.rest():
            listed = f"one of {', '.join(sorted(self._asked))}"
            self.wrong(key, f"unknown key; {nearest(key, self._asked)}", listed, near=closest(key, self._asked))

    def without(self, key: str, text: str, remedy: str) -> None:
        """Note that a key has no place here."""
        self.wrong(key, f"{text}; {remedy}", "no such key here")


def file_at(text: str, folder: Path) -> Path:
    """A path of the file as written, relative ones from the folder of the configuration."""
    path = Path(text).expanduser()
    return path if path.is_absolute() else folder / path
