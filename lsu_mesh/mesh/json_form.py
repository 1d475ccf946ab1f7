"""Messages as JSON that JavaScript reads without loss: integers of 64 bits are strings.

Those are times (their names end with ``_ns``) and ``seq``, in references too. All other numbers are numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

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
        **_safe(msgspec.to_builtins(message)),
        "arrival_ns": str(arrival_ns),
    }


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
    return [_reference(one) for one in value] if name == "used" else value


def _reference(value: list[Any] | tuple[Any, ...]) -> list[Any]:
    """``[topic, src, boot, seq]``."""
    return [*value[:3], str(value[3])]
