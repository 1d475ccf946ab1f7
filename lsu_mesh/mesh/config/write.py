"""TOML text of configuration values: the way back from what a file was read into."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

BARE = re.compile(r"[A-Za-z0-9_-]+")


def to_toml(values: Mapping[str, Any]) -> str:
    """Text from which ``tomllib`` reads the same tables, strings, numbers, booleans and lists, bit by bit."""
    return "\n".join(_lines(values, "")).lstrip("\n") + "\n"


def _lines(table: Mapping[str, Any], path: str) -> list[str]:
    plain = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    lines = [f"\n[{path}]"] if path and (plain or not table) else []
    lines += [f"{_key(key)} = {value_text(value)}" for key, value in plain.items()]
    for key, value in table.items():
        if isinstance(value, Mapping):
            lines += _lines(value, f"{path}.{_key(key)}" if path else _key(key))
    return lines


def _key(text: str) -> str:
    return text if BARE.fullmatch(text) else _text(text)


def value_text(value: Any) -> str:
    """TOML text of one value; raises ``TypeError`` for what TOML has no text for here, as dates."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {value_text(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(value_text, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool | int | float):
        return json.dumps(value)
    raise TypeError(f"no TOML for {type(value).__name__} {value!r}")


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")  # the rest is escaped as in JSON
