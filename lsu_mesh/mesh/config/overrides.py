"""Values of flags (``-X table.key=value``) and of the environment (``LSU_MESH_TABLE__KEY``) over those of a file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import Any, NamedTuple

from lsu_mesh.mesh.config.exact_times import is_moment, with_all_digits
from lsu_mesh.mesh.config.expected import SHOWN_LENGTH
from lsu_mesh.mesh.config.filters import ALIASES, TRANSFER
from lsu_mesh.mesh.config.network import SECRET
from lsu_mesh.mesh.config.problem import Problems

ENVIRONMENT_PREFIX = "LSU_MESH_"
FORM = "table.key=value, such as mesh.steps=100"


class Override(NamedTuple):
    """``source`` is what the user wrote: the flag, or the name of the variable."""

    key: str
    value: str
    source: str


def from_flags(texts: Sequence[str], problems: Problems) -> list[Override]:
    """What ``-X`` says; what has no equals sign is noted."""
    found = []
    for text in texts:
        key, sign, value = text.partition("=")
        if sign:
            found.append(Override(key.strip(), value.strip(), f"-X {key.strip()}={_shortened(value.strip())}"))
        else:
            problems.add("", f"-X {_shortened(text)}", f"expected {FORM}", expected=FORM, found=_shortened(text))
    return found


def _shortened(value: str) -> str:
    """The value as it may be repeated: no secret, and no more than is needed to find it."""
    if SECRET in value:
        return "…"
    return value if len(value) <= SHOWN_LENGTH else value[: SHOWN_LENGTH - 1] + "…"


def from_environment(environment: Mapping[str, str]) -> list[Override]:
    """The variables ``LSU_MESH_TABLE__KEY`` by name; one underscore belongs to the key."""
    return [
        Override(name.removeprefix(ENVIRONMENT_PREFIX).lower().replace("__", "."), value, name)
        for name, value in sorted(environment.items())
        if name.startswith(ENVIRONMENT_PREFIX) and "__" in name
    ]


def apply(values: dict[str, Any], overrides: Sequence[Override], problems: Problems) -> None:
    """Put each value in its place in ``values``, and remember where it came from."""
    for override in overrides:
        *tables, last = override.key.split(".")
        table: Any = values if tables and all((*tables, last)) else None
        for name in tables:
            table = _inner(table, name) if isinstance(table, dict) else None
        if not isinstance(table, dict):
            problems.add("", override.source, f"expected {FORM}", expected=FORM, found=_shortened(override.value))
            continue
        for other in _other_spellings(tables, last):
            table.pop(other, None)
        table[last] = _value(override.value, keeps_digits=is_moment(override.key))
        problems.sources[override.key] = override.source


def _inner(table: dict[str, Any], name: str) -> Any:
    """The table of a name, which may not be there yet; that of a transfer may be written as its word alone."""
    if name == TRANSFER and isinstance(table.get(name), str):
        table[name] = {"way": table[name]}
    return table.setdefault(name, {})


def _other_spellings(tables: Sequence[str], key: str) -> list[str]:
    """The alias of a key, or the key of an alias: the flag is meant for the same option."""
    spellings = [pair for pair in ALIASES.items() if key in pair] if tables[0] == "filters" else []
    return [name for pair in spellings for name in pair if name != key]


def _value(text: str, *, keeps_digits: bool) -> Any:
    line = f"value = {text}"
    try:
        value = tomllib.loads(line)["value"]
        return with_all_digits(value, tomllib.loads(line, parse_float=Decimal)["value"]) if keeps_digits else value
    except (ValueError, RecursionError):
        return text  # a bare word is a string
