"""The options of a filter's own class: checked against its constructor, then tried on it."""

from __future__ import annotations

import inspect
import re
import typing
from collections.abc import Callable, Collection, Mapping
from typing import Any

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config.expected import Expected
from lsu_mesh.mesh.config.model_errors import add_model_error
from lsu_mesh.mesh.config.option_types import ANYTHING, expected_of
from lsu_mesh.mesh.config.table import REQUIRED, Table

GIVEN_BY_THE_MESH = ("model", "prior")
Make = Callable[[Mapping[str, Any]], object]


class FilterOptions:
    """The parameters of a class's constructor, but for model and prior."""

    def __init__(self, cls: type) -> None:
        self.cls = cls
        parameters = inspect.signature(cls).parameters.values()
        self.takes_any = any(one.kind is one.VAR_KEYWORD for one in parameters)
        positional = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
        self.parameters = [
            one for one in parameters if one.name not in GIVEN_BY_THE_MESH and one.kind not in positional
        ]
        self.hints = _hints(cls)

    @property
    def required(self) -> list[str]:
        """Names of the options without a default."""
        return [one.name for one in self.parameters if one.default is one.empty]

    @property
    def names(self) -> list[str]:
        """Names of the options."""
        return [one.name for one in self.parameters]

    def expected(self, name: str) -> Expected[Any]:
        """What this option has to be."""
        return expected_of(self.hints[name]) if name in self.hints else ANYTHING

    def read(self, table: Table) -> dict[str, Any]:
        """The options that the table gives, converted; notes each that is unknown, missing or not as expected."""
        options = table.rest() if self.takes_any else {}
        for parameter in self.parameters:
            expected = self.expected(parameter.name)
            default = REQUIRED if parameter.default is parameter.empty else None
            value = table.read(parameter.name, default, expected)
            if parameter.name in table.values:
                options[parameter.name] = value
        if not self.takes_any:
            table.finish()
        return options


def _hints(cls: type) -> dict[str, Any]:
    """The annotations that can be resolved; a class whose imports are for type checkers only checks for itself."""
    try:
        return typing.get_type_hints(cls.__init__, include_extras=True)  # type: ignore[misc]
    except (NameError, TypeError, AttributeError):
        return {}


def try_options(table: Table, make: Make, options: Mapping[str, Any], required: Collection[str]) -> None:
    """Make the filter; what its constructor refuses is noted, one option after the other.

    A constructor tells one mistake at a time, so each option that it refuses is left out and the rest is tried again,
    unless it is one of those that are ``required``.
    """
    left = dict(options)
    while True:
        sentence = _refusal(make, left)
        if not sentence:
            return
        key = _blamed(sentence, make, left, required)
        add_model_error(table, sentence, key)
        if not key or key in required:
            return
        del left[key]


def _refusal(make: Make, options: Mapping[str, Any]) -> str:
    """What the constructor says against these options; empty where it takes them."""
    try:
        make(options)
    except ModelError as error:
        return str(error)
    except Exception as error:  # the class may be anyone's; its mistake is one of the configuration, not a crash
        return f"the class refuses these options: {type(error).__name__}: {error}"
    return ""


def _blamed(sentence: str, make: Make, options: Mapping[str, Any], required: Collection[str]) -> str:
    """The option that a sentence begins with or names, or without which it does not come; empty for none."""
    words = re.findall(r"\w+", sentence)
    for name in (*words[:1], *options):
        if name in words and name in options:
            return str(name)
    for name in [name for name in options if name not in required]:
        if _refusal(make, {key: value for key, value in options.items() if key != name}) != sentence:
            return str(name)
    return next(iter(required)) if len(required) == 1 and set(required) <= options.keys() else ""
