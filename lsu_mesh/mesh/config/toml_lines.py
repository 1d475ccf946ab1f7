"""The line of each key of a TOML text. ``tomllib`` checks the text and gives the values, but no lines.

The scanner walks over a text that ``tomllib`` has accepted, so that it may be simple: it finds keys, and skips values.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator

BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
BARE = re.compile(r"[A-Za-z0-9_-]+")
BASIC = re.compile(r'"((?:[^"\\\n]|\\.)*)"')
LITERAL = re.compile(r"'([^'\n]*)'")
LONG_BASIC = re.compile(r'"""(?:[^\\]|\\.)*?"""(?:""?(?!"))?', re.DOTALL)
LONG_LITERAL = re.compile(r"'''.*?'''(?:''?(?!'))?", re.DOTALL)
SCALAR = re.compile(r"[^,\]}#\n]+")
SPACE = re.compile(r"[ \t]*")
DOT = re.compile(r"[ \t]*\.[ \t]*")

KeyPath = tuple[str | int, ...]


class NotFollowed(Exception):
    """The text is not what the scanner expects."""


def key_lines(text: str) -> dict[str, int]:
    """Line of each table and key from 1, by paths such as ``filters.cz.kind`` or ``sensors.s1.faults[0].size``.

    Keys that would share a path, as ``"a.b"`` and a key ``b`` of a table ``a``, are left out; of a text that cannot be
    followed nothing is given.
    """
    try:
        found = _Scanner(text).lines()
    except (NotFollowed, RecursionError):
        return {}
    lines: dict[str, int] = {}
    shared: set[str] = set()
    for path, line in found.items():
        name = _name(path)
        shared |= {name} & lines.keys()
        lines[name] = line
    return {name: line for name, line in lines.items() if name not in shared}


def _name(path: KeyPath) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).removeprefix(".")


class _Scanner:
    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._ends = [match.start() for match in re.finditer("\n", text)]
        self._found: dict[KeyPath, int] = {}
        self._counts: dict[KeyPath, int] = {}

    def lines(self) -> dict[KeyPath, int]:
        """Walk over the whole text."""
        table: KeyPath = ()
        while self._skip_blank():
            if self._text.startswith("[", self._at):
                table = self._header()
            else:
                self._pair(table)
        return self._found

    def _skip_blank(self) -> bool:
        """Go to the next character that means something; whether there is one."""
        self._take(BLANK)
        return self._at < len(self._text)

    def _take(self, pattern: re.Pattern[str]) -> re.Match[str]:
        match = pattern.match(self._text, self._at)
        if match is None:
            raise NotFollowed
        self._at = match.end()
        return match

    def _expect(self, word: str) -> None:
        self._take(SPACE)
        if not self._text.startswith(word, self._at):
            raise NotFollowed
        self._at += len(word)

    def _line(self) -> int:
        return bisect_left(self._ends, self._at) + 1

    def _header(self) -> KeyPath:
        line, is_list = self._line(), self._text.startswith("[[", self._at)
        self._expect("[[" if is_list else "[")
        *outer, last = self._key()
        self._expect("]]" if is_list else "]")
        path = self._below((), outer, line)
        path = (*path, last)
        if is_list:
            count = self._counts[path] = self._counts.get(path, 0) + 1
            self._found.setdefault(path, line)
            path = (*path, count - 1)
        self._found[path] = line
        return path

    def _below(self, path: KeyPath, parts: list[str], line: int) -> KeyPath:
        """The tables that ``parts`` lead to; of a list of tables it is the last one."""
        for part in parts:
            path = (*path, part)
            self._found.setdefault(path, line)
            if path in self._counts:
                path = (*path, self._counts[path] - 1)
        return path

    def _pair(self, table: KeyPath) -> None:
        line = self._line()
        *outer, last = self._key()
        path = (*self._below(table, outer, line), last)
        self._expect("=")
        self._found[path] = line
        self._skip_blank()
        self._value(path)

    def _key(self) -> list[str]:
        parts = []
        while True:
            self._take(SPACE)
            parts.append(self._key_part())
            if DOT.match(self._text, self._at) is None:
                return parts
            self._take(DOT)

    def _key_part(self) -> str:
        if self._text.startswith('"', self._at):
            return _unescaped(self._take(BASIC)[1])
        if self._text.startswith("'", self._at):
            return self._take(LITERAL)[1]
        return self._take(BARE)[0]

    def _value(self, path: KeyPath) -> None:
        for start, pattern in (('"""', LONG_BASIC), ("'''", LONG_LITERAL), ('"', BASIC), ("'", LITERAL)):
            if self._text.startswith(start, self._at):
                self._take(pattern)
                return
        if self._text.startswith("[", self._at):
            for number in self._items("]"):
                if self._text.startswith(("{", "["), self._at):
                    self._found[(*path, number)] = self._line()
                self._value((*path, number))
        elif self._text.startswith("{", self._at):
            for _ in self._items("}"):
                self._pair(path)
        else:
            self._take(SCALAR)

    def _items(self, end: str) -> Iterator[int]:
        """Stand at each item of a list or of an inline table, one after the other; then behind its end."""
        self._at += 1
        number = 0
        while self._skip_blank():
            if self._text.startswith(end, self._at):
                self._at += 1
                return
            yield number
            number += 1
            self._skip_blank()
            if self._text.startswith(",", self._at):
                self._at += 1
            elif not self._text.startswith(end, self._at):
                raise NotFollowed
        raise NotFollowed


def _unescaped(text: str) -> str:
    if "\\" not in text:
        return text
    short = {"b": "\b", "t": "\t", "n": "\n", "f": "\f", "r": "\r", '"': '"', "\\": "\\"}

    def replaced(match: re.Match[str]) -> str:
        return short[match[1]] if match[1] in short else chr(int(match[1][1:], 16))

    return re.sub(r"\\(u[0-9A-Fa-f]{4}|U[0-9A-Fa-f]{8}|.)", replaced, text)
