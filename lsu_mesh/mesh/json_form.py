"""Messages as JSON that JavaScript reads without loss: integers of 64 bits are strings.

Those are times (their names end with ``_ns``) and ``seq``, in references too. All other numbers are numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import msgspec

from lsu_mesh.mesh.bank_messages import STATUSES, BankMessage
from lsu_mesh.mesh.messages import Fused, Message, Posterior

Json = dict[str, Any]
COMMON = ("src", "boot", "seq", "step", "sent_ns", "origin_ns")
OF_ESTIMATE = (
    "kind", "lower", "upper", "point", "log_volume", "status", "revision", "epoch", "guarantee", "missing", "cause",
)  # fmt: skip
OF_FUSED = ("policy", "faults", "rejected", "quarantined")


def dumps(value: object) -> bytes:
    """One line of JSON."""
    return msgspec.json.encode(value)


def whole(message: Message, arrival_ns: int) -> Json:
    """All fields of a message."""
    return {
        "topic": message.topic,
        "name": message.name,
        **_safe(plain(message)),
        "arrival_ns": str(arrival_ns),
    }


def plain(message: Message) -> Json:
    """The fields as plain values; the arrays of a bank as rows of numbers, None for NaN, and its statuses as words."""
    values: Json = msgspec.to_builtins(message, builtin_types=(bytes,))
    if isinstance(message, BankMessage):
        for name in [name for name, value in values.items() if isinstance(value, bytes)]:
            values[name] = (
                [STATUSES[code] for code in values[name]]
                if name == "statuses"
                else [[None if math.isnan(one) else one for one in row] for row in message.matrix(name).tolist()]
            )
    return values


def estimate(message: Posterior, arrival_ns: int) -> Json:
    """A set's bounds and point, without the set itself and its provenance."""
    fields = (*COMMON, *OF_ESTIMATE, *(OF_FUSED if isinstance(message, Fused) else ()))
    values = {name: getattr(message, name) for name in fields}
    if isinstance(message, Fused):
        values["rejected"] = [{"source": one.source, "reason": one.reason} for one in message.rejected]
    return {"topic": message.topic, "name": message.name, **_safe(values), "arrival_ns": str(arrival_ns)}


def _safe(values: Mapping[str, Any]) -> Json:
    return {name: _safe_value(name, value) for name, value in values.items()}


def _safe_value(name: str, value: Any) -> Any:
    if isinstance(value, int) and not isinstance(value, bool) and (name.endswith("_ns") or name == "seq"):
        return str(value)
    if isinstance(value, dict):
        return _safe(value)
    if name == "base" and isinstance(value, list | tuple):
        return _reference(value)
    if name == "used" and isinstance(value, list | tuple):
        return [_reference(one) for one in value]
    return value


def _reference(value: list[Any] | tuple[Any, ...]) -> list[Any]:
    """``[topic, src, boot, seq]``."""
    return [*value[:3], str(value[3])]
