"""Reading one TOML table: typed values, defaults, and every mistake with its place and remedy."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

from lsu_mesh.errors import LsuMeshError

T = TypeVar("T")
Word = TypeVar("Word", bound=str)
REQUIRED: Any = object()
_DURATION = re.compile(r"(\d+(?:\.\d+)?)\s*(us|ms|s|min)")
_UNIT_SECONDS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0}


def _word(value: Any) -> Any:
    return value if isinstance(value, str) else None


class ConfigurationError(LsuMeshError):
    """A configuration is wrong; ``problems`` holds one line per mistake."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__("\n".join(problems))
        self.problems = tuple(problems)


class Problems:
    """The mistakes found so far, each with file and place, and the keys that were asked for."""

    def __init__(self, file: str, *, reads_files: bool = True) -> None:
        self.file = file
        self.reads_files = reads_files
        """Whether files of measurements are looked into; of a recorded configuration they may be gone."""
        self.lines: list[str] = []
        self.asked: set[str] = set()

    def add(self, place: str, text: str) -> None:
        """Note a mistake; ``place`` is like ``[filters.cz] kind``."""
        self.lines.append(f"{self.file}: {place}: {text}" if place else f"{self.file}: {text}")

    def raise_if_any(self) -> None:
        """Raise :class:`ConfigurationError` when there was a mistake."""
        if self.lines:
            raise ConfigurationError(self.lines)


def nearest(word: str, known: Iterable[str]) -> str:
    """`` did you mean "x"?`` for the closest known word, else the list of them."""
    words = sorted(known)
    close = difflib.get_close_matches(word, words, n=1, cutoff=0.5)
    if close:
        return f'did you mean "{close[0]}"?'
    return f"known here: {', '.join(words)}" if words else "none is known here"


class Table:
    """One table of the file. Keys that nobody asks for are unknown; :meth:`finish` says so."""

    def __init__(self, values: object, path: str, problems: Problems) -> None:
        self.path = path
        self.problems = problems
        self._asked: list[str] = []
        if not isinstance(values, dict):
            problems.add(f"[{path}]", f"expected a table, found {_shown(values)}")
            values = {}
        self.values: dict[str, Any] = values

    def wrong(self, key: str, text: str) -> None:
        """Note a mistake at a key of this table."""
        self.problems.add(f"[{self.path}] {key}" if self.path else key, text)

    def read(self, key: str, default: T, expected: str, convert: Callable[[Any], T | None]) -> T:
        """The value at ``key`` by ``convert`` (None: not as expected), or the default."""
        self._asked.append(key)
        self.problems.asked.add(f"{self.path}.{key}" if self.path else key)
        if key not in self.values:
            if default is REQUIRED:
                self.wrong(key, f"is missing; expected {expected}")
            return default
        value = convert(self.values[key])
        if value is None:
            self.wrong(key, f"expected {expected}, found {_shown(self.values[key])}")
            return default
        return value

    def text(self, key: str, default: Any = REQUIRED) -> Any:
        """A string."""
        return self.read(key, default, "a string", lambda v: v if isinstance(v, str) and v else None)

    def choice(self, key: str, choices: Sequence[Word], default: Word) -> Word:
        """One of a few words."""
        found: Any = self.read(key, default, "a string", _word)
        if found is not REQUIRED and found not in choices:
            self.wrong(key, f'"{found}" is no choice; {nearest(found, choices)} (choices: {", ".join(choices)})')
            return choices[0]
        return cast("Word", found)

    def flag(self, key: str, default: bool) -> bool:
        """true or false."""
        return self.read(key, default, "true or false", lambda v: v if isinstance(v, bool) else None)

    def whole(self, key: str, default: Any = REQUIRED, low: int = 0, high: int = 2**53) -> Any:
        """An integer within limits."""
        limits = f"a whole number ≥ {low}" if high == 2**53 else f"a whole number from {low} to {high}"

        def convert(v: Any) -> int | None:
            return v if isinstance(v, int) and not isinstance(v, bool) and low <= v <= high else None

        return self.read(key, default, limits, convert)

    def number(self, key: str, default: Any = REQUIRED, above: float = -math.inf) -> Any:
        """A finite number, larger than ``above``."""
        limits = "a finite number" if above == -math.inf else f"a number > {above:g}"

        def convert(v: Any) -> float | None:
            return float(v) if _is_number(v) and v > above else None

        return self.read(key, default, limits, convert)

    def duration(self, key: str, default: float, low: float = 0.0) -> float:
        """A time such as "50ms" in seconds."""

        def convert(v: Any) -> float | None:
            match = _DURATION.fullmatch(v) if isinstance(v, str) else None
            seconds = float(match[1]) * _UNIT_SECONDS[match[2]] if match else None
            return seconds if seconds is not None and seconds >= low else None

        return self.read(key, default, f'a duration of at least {low:g} s such as "50ms", "0.2s" or "1min"', convert)

    def vector(self, key: str, default: Any = REQUIRED) -> Any:
        """A list of finite numbers."""
        return self.read(key, default, "a list of finite numbers", _vector)

    def matrix(self, key: str, default: Any = REQUIRED) -> Any:
        """A list of rows of one length."""

        def convert(v: Any) -> list[list[float]] | None:
            rows = [_vector(row) for row in v] if isinstance(v, list) and v else [None]
            good = [row for row in rows if row is not None]
            return good if len(good) == len(rows) and len({len(row) for row in good}) == 1 else None

        return self.read(key, default, "a matrix: a list of rows of one length, of finite numbers", convert)

    def texts(self, key: str, default: Any = REQUIRED) -> Any:
        """A list of strings."""

        def convert(v: Any) -> list[str] | None:
            return v if isinstance(v, list) and all(isinstance(item, str) for item in v) else None

        return self.read(key, default, "a list of strings", convert)

    def tables(self, key: str) -> list[Table]:
        """A list of tables."""

        def convert(v: Any) -> list[Any] | None:
            return v if isinstance(v, list) and all(isinstance(item, dict) for item in v) else None

        found: list[Any] = self.read(key, [], "a list of tables such as [{kind = …}]", convert)
        return [Table(item, f"{self.path}.{key}[{i}]", self.problems) for i, item in enumerate(found)]

    def table(self, key: str, *, required: bool = False) -> Table | None:
        """A table inside this one; ``None`` when it is not there."""
        self._asked.append(key)
        path = f"{self.path}.{key}" if self.path else key
        if key not in self.values:
            if required:
                self.problems.add(f"[{path}]", "this table is missing")
            return None
        return Table(self.values[key], path, self.problems)

    def rest(self) -> dict[str, Any]:
        """The keys that nobody has asked for yet."""
        return {key: value for key, value in self.values.items() if key not in self._asked}

    def finish(self) -> None:
        """Say which keys are unknown."""
        for key in self.rest():
            self.wrong(key, f"unknown key; {nearest(key, self._asked)}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _vector(value: Any) -> list[float] | None:
    if not isinstance(value, list) or not all(_is_number(item) for item in value):
        return None
    return [float(item) for item in value]


def _shown(value: object) -> str:
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "…"


def file_at(text: str, folder: Path) -> Path:
    """A path of the file as written, relative ones from the folder of the configuration."""
    path = Path(text).expanduser()
    return path if path.is_absolute() else folder / path
