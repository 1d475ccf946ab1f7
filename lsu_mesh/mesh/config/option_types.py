"""What an option of a filter has to be, from the annotation of the constructor's parameter."""

from __future__ import annotations

import enum
import types
import typing
from collections import abc
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config import expected
from lsu_mesh.mesh.config.expected import WHOLE_LIMIT, Expected, Unfit, as_list, as_text, is_number, is_real
from lsu_mesh.supports.orthotope import Orthotope

ANYTHING = Expected("a value that the class takes", lambda value: value)
LISTS = (list, tuple, abc.Sequence, abc.Iterable, abc.Collection, abc.MutableSequence)
SETS = (set, frozenset, abc.Set)
MAPPINGS = (dict, abc.Mapping, abc.MutableMapping)


def expected_of(hint: Any) -> Expected[Any]:
    """Words and strict conversion of an annotation; what is not known here is left to the class (``ANYTHING``).

    A float takes whole numbers, an int takes no 20.0, a bool takes true and false only. ``Literal`` and enumerations
    are choices. ``ArrayLike`` is a number or lists of numbers, :class:`Orthotope` a table with ``lower`` and ``upper``,
    a ``NamedTuple`` a list or a table of its fields.
    """
    plain: dict[Any, Expected[Any]] = {
        bool: expected.FLAG,
        int: WHOLE,
        float: expected.number(),
        str: expected.STRING,
        Path: Expected("a path", lambda value: Path(as_text(value))),
        Orthotope: BOX,
        ArrayLike: ARRAY,
    }
    try:
        if hint in plain:
            return plain[hint]
    except TypeError:  # an annotation that has no hash
        return ANYTHING
    if isinstance(hint, type) and get_origin(hint) is None:
        return _of_class(hint)
    return _of_form(hint)


def _of_class(hint: type) -> Expected[Any]:
    if issubclass(hint, enum.Enum):
        words = expected.choice([member.value for member in hint])
        return Expected(words.words, lambda value: hint(words.convert(value)))
    if issubclass(hint, tuple) and hasattr(hint, "_fields"):
        return _named_tuple(hint)
    if issubclass(hint, np.ndarray):
        return ARRAY
    if hint in LISTS:
        return Expected("a list", lambda value: as_list(value, ANYTHING))
    return Expected("a table", expected.as_table) if hint in MAPPINGS else ANYTHING


def _of_form(hint: Any) -> Expected[Any]:
    """Annotations with parameters."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Literal:
        return expected.choice(parts)
    if origin is Annotated:
        return expected_of(parts[0])
    if origin in (Union, types.UnionType):
        return _union(parts)
    if origin is tuple and parts[-1:] != (Ellipsis,):
        return _fixed_tuple(parts)
    if origin in LISTS or origin in SETS:
        return _list(origin, parts[0])
    if origin in MAPPINGS:
        return _mapping(parts[1])
    if isinstance(origin, type) and issubclass(origin, np.ndarray):
        return ARRAY
    if hasattr(hint, "__value__"):  # ``type X = …``
        return expected_of(hint.__value__)
    return expected_of(hint.__supertype__) if hasattr(hint, "__supertype__") else ANYTHING


def _union(parts: tuple[Any, ...]) -> Expected[Any]:
    if set(parts) >= set(get_args(ArrayLike)) and get_args(ArrayLike):
        parts = (*(part for part in parts if part not in get_args(ArrayLike)), ArrayLike)
    members = [expected_of(part) for part in parts if part is not types.NoneType]
    fields = [expected_of(part) for part in parts if isinstance(part, type) and hasattr(part, "_fields")]
    if len(members) == 1:
        only = members[0]
        return Expected(only.words, lambda value: None if value is None else only.convert(value))
    exact = [expected_of(part) for part in parts if part in (bool, int)]  # before float, which takes whole numbers

    def convert(value: Any) -> Any:
        if value is None and types.NoneType in parts:
            return None
        # A list or table that may be a NamedTuple is one: Sequence[object] beside it would take any.
        tried = fields if fields and isinstance(value, list | tuple | dict) else [*exact, *members]
        unfits = []
        for member in tried:
            try:
                return member.convert(value)
            except Unfit as unfit:
                unfits.append(unfit)
        raise next((one for one in unfits if one.nearest or one.remedy), unfits[0])

    return Expected(" or ".join(dict.fromkeys(one.words for one in fields or members)), convert)


def _list(origin: Any, part: Any) -> Expected[Any]:
    item = expected_of(part)
    make: Callable[[Any], Any] = {tuple: tuple, set: set, frozenset: frozenset, abc.Set: frozenset}.get(origin, list)
    return Expected(f"a list, each item {item.words}", lambda value: make(as_list(value, item)))


def _fixed_tuple(parts: tuple[Any, ...]) -> Expected[Any]:
    items = [expected_of(part) for part in parts]
    words = f"a list of {len(items)}: {', '.join(item.words for item in items)}"
    return Expected(words, lambda value: tuple(_each(value, items, [f"item {n + 1}" for n in range(len(items))])))


def _each(value: Any, items: list[Expected[Any]], names: list[str]) -> list[Any]:
    if not isinstance(value, list | tuple):
        raise Unfit
    if len(value) != len(items):
        raise Unfit(f"it has {len(value)}")
    converted = []
    for name, item, one in zip(names, items, value, strict=True):
        try:
            converted.append(item.convert(one))
        except Unfit as unfit:
            raise Unfit(f"{name}: {item.explain(one, unfit)}", nearest=unfit.nearest) from None
    return converted


def _mapping(part: Any) -> Expected[Any]:
    item = expected_of(part)

    def convert(value: Any) -> dict[str, Any]:
        keys = list(expected.as_table(value))
        return dict(zip(keys, _each(list(value.values()), [item] * len(keys), keys), strict=True))

    return Expected(f"a table, each value {item.words}", convert)


def _named_tuple(hint: Any) -> Expected[Any]:
    names = list(hint._fields)
    hints = typing.get_type_hints(hint)
    items = [expected_of(hints.get(name, Any)) for name in names]
    words = f"a list [{', '.join(names)}], or a table with these keys"

    def convert(value: Any) -> Any:
        if isinstance(value, dict):
            if set(value) != set(names):
                raise Unfit(f"it has the keys {', '.join(value) or 'none'}")
            value = [value[name] for name in names]
        return hint(*_each(value, items, names))

    return Expected(words, convert)


def _as_array(value: Any) -> Any:
    """Numbers in lists of one shape; infinity may be a limit, so it is left to the class."""
    if is_real(value):
        return value
    if not isinstance(value, list | tuple):
        raise Unfit
    shapes = {np.shape(item) for item in map(_as_array, value)}
    if len(shapes) > 1:
        raise Unfit("its rows have different lengths")
    return value


def _as_box(value: Any) -> Orthotope:
    sides = [value.get("lower"), value.get("upper")] if isinstance(value, Mapping) and len(value) == 2 else value
    if not isinstance(sides, list | tuple) or len(sides) != 2:
        raise Unfit
    if not all(isinstance(side, list) and all(map(is_number, side)) for side in sides):
        raise Unfit
    try:
        return Orthotope(*sides)
    except ModelError as error:
        raise Unfit(str(error)) from None


WHOLE = Expected("a whole number", expected.whole(-WHOLE_LIMIT, WHOLE_LIMIT).convert)
ARRAY = Expected("a number, or a list or matrix of numbers", _as_array)
BOX = Expected("a box {lower = [numbers], upper = [numbers]}", _as_box)
