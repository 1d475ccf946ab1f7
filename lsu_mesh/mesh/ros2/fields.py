"""Paths into a message, such as ``pose.position.x`` or ``ranges[3]``: checked against its type, and compiled once."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Step: TypeAlias = str | int
"""The name of a field, or a place in a list."""
FIELD_RULE = 'a path into the message, such as "pose.position.x" or "ranges[3]"'
_PATH = re.compile(r"[A-Za-z_]\w*(\[\d{1,9}\])?(\.[A-Za-z_]\w*(\[\d{1,9}\])?)*", re.ASCII)
_NUMBERS = re.compile(r"u?int(8|16|32|64)|float(32|64)|byte|octet|char")


class NoSuchField(Exception):
    """A path does not lead to a number; ``name`` was not found, ``known`` are the names there, or none."""

    def __init__(self, text: str, name: str = "", known: Sequence[str] = ()) -> None:
        super().__init__(text)
        self.name = name
        self.known = tuple(known)


def parse_path(text: str) -> tuple[Step, ...] | None:
    """The steps of a path; None where it is none."""
    if _PATH.fullmatch(text) is None:
        return None
    return tuple(int(one) if one[0].isdigit() else one for one in re.findall(r"[A-Za-z_]\w*|\d+", text))


def check_path(store: Typestore, type_name: str, text: str) -> None:
    """Raise :class:`NoSuchField` where a path does not lead to a number of such a message."""
    from rosbags.interfaces import Nodetype

    path = parse_path(text)
    if path is None:
        raise NoSuchField(f'"{text}" is no path; expected {FIELD_RULE}')
    node: Any = (Nodetype.NAME, type_name)
    for step in path:
        kind, about = node
        if isinstance(step, int):
            node = _element(kind, about, step, text)
            continue
        if kind != Nodetype.NAME:
            raise NoSuchField(f'"{text}": {_described(node)} has no field "{step}"')
        known: dict[str, Any] = dict(store.fielddefs[about][1])
        if step not in known:
            raise NoSuchField(f'"{text}": {about} has no field "{step}"', step, list(known))
        node = known[step]
    kind, about = node
    if kind != Nodetype.BASE or not _NUMBERS.fullmatch(about[0]):
        raise NoSuchField(f'"{text}" is no number, it is {_described(node)}; go on to one of its numbers')


def _element(kind: Any, about: Any, place: int, text: str) -> Any:
    from rosbags.interfaces import Nodetype

    if kind not in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        raise NoSuchField(f'"{text}": [{place}] needs a list, and there is {_described((kind, about))}')
    element, length = about
    if length and place >= length:
        raise NoSuchField(f'"{text}": the list has {length} entries, [0] to [{length - 1}]')
    return element


def _described(node: Any) -> str:
    from rosbags.interfaces import Nodetype

    kind, about = node
    if kind == Nodetype.NAME:
        return f"a {about}"
    if kind == Nodetype.BASE:
        return f"a {about[0]}"
    return f"a list of {_described(about[0]).removeprefix('a ')}"


def numbers_of(store: Typestore, type_name: str) -> list[str]:
    """Paths to all numbers of a type; of a list, the one to its first entry."""
    found: list[str] = []
    _find_numbers(store, ("", type_name), found)
    return found


def _find_numbers(store: Typestore, at: tuple[str, str], found: list[str]) -> None:
    from rosbags.interfaces import Nodetype

    before, type_name = at
    fields: Any = store.fielddefs[type_name][1]
    for name, (kind, about) in fields:
        path = f"{before}{name}"
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            path, (kind, about) = f"{path}[0]", about[0]
        if kind == Nodetype.NAME:
            _find_numbers(store, (f"{path}.", about), found)
        elif kind == Nodetype.BASE and _NUMBERS.fullmatch(about[0]):
            found.append(path)


def compile_path(text: str) -> Callable[[Any], Any]:
    """A function that takes a message and returns what the path leads to; IndexError beyond the end of a list."""
    path = parse_path(text)
    assert path is not None
    getters: list[Callable[[Any], Any]] = []
    names: list[str] = []
    for step in path:
        if isinstance(step, str):
            names.append(step)
            continue
        getters += [operator.attrgetter(".".join(names))] if names else []
        getters.append(operator.itemgetter(step))
        names = []
    getters += [operator.attrgetter(".".join(names))] if names else []
    return getters[0] if len(getters) == 1 else _chained(getters)


def _chained(getters: Sequence[Callable[[Any], Any]]) -> Callable[[Any], Any]:
    def get(message: Any) -> Any:
        for getter in getters:
            message = getter(message)
        return message

    return get
