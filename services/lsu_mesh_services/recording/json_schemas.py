"""JSON schemas of the messages, and what is added to them for drawing: numbers by the names of states and outputs.

Foxglove and its kin read a schema's own properties of one plain type, and lists of such: no ``null``, no choices, no
lists in lists. A schema tells those fields; what else a message has stands in the message beside them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.json_form import Json, whole
from lsu_mesh.mesh.messages import TYPES, Measurement, Message, Posterior, Prediction, Smoothed, Truth
from lsu_mesh_services.recording.entity_paths import outputs_of, told_apart

PLAIN = ("string", "number", "integer", "boolean")
WITH_STATES = ("truth", "prediction", "posterior", "smoothed", "fused")
TEXT: Json = {"type": "string"}


class JsonMessages:
    """Messages of one mesh as JSON objects, with ``states`` (``{"x1": {"lower": …}}``) or ``outputs`` by name."""

    def __init__(self, configuration: Configuration) -> None:
        self._states = told_apart(configuration.base_model.states)
        self._outputs = {
            name: [output.part for output in outputs_of(sensor)] for name, sensor in configuration.sensors.items()
        }

    def schema(self, topic: str, name: str) -> Json:
        """Of the messages of one key."""
        full = msgspec.json.schema(TYPES[topic])
        kinds = full.get("$defs", {})
        fields = _properties(kinds[full["$ref"].rpartition("/")[2]], kinds)
        added = {"topic": TEXT, "name": TEXT, "arrival_ns": TEXT}
        if topic in WITH_STATES:
            number = {"type": "number"}
            parts = ("value",) if topic == "truth" else ("lower", "upper")
            parts = (*parts, "point") if topic in ("posterior", "fused") else parts
            of_state = {"type": "object", "properties": dict.fromkeys(parts, number), "required": list(parts)}
            added["states"] = {"type": "object", "properties": dict.fromkeys(self._states, of_state)}
        elif topic == "measurement":
            outputs = {output: {"type": "number"} for output in self._outputs.get(name, ())}
            added["outputs"] = {"type": "object", "properties": outputs}
        return {"title": f"lsu.{topic}", "type": "object", "properties": added | fields}

    def form(self, message: Message, arrival_ns: int) -> Json:
        """All fields of a message, integers of 64 bits as strings, and the numbers that it has by name."""
        told = whole(message, arrival_ns)
        if isinstance(message, Truth):
            told["states"] = self._by_state({"value": message.x})
        elif isinstance(message, Posterior):
            told["states"] = self._by_state({"lower": message.lower, "upper": message.upper, "point": message.point})
        elif isinstance(message, Prediction | Smoothed):
            told["states"] = self._by_state({"lower": message.lower, "upper": message.upper})
        elif isinstance(message, Measurement):
            pairs = zip(self._outputs.get(message.name, ()), message.y, strict=False)
            told["outputs"] = {name: value for name, value in pairs if value is not None}
        return told

    def _by_state(self, parts: dict[str, Sequence[float]]) -> Json:
        return {state: {part: values[i] for part, values in parts.items()} for i, state in enumerate(self._states)}


def _properties(kind: Json, kinds: Json) -> Json:
    """The fields of a message of one plain type."""
    found = {}
    for name, field in kind["properties"].items():
        plain = TEXT if name.endswith("_ns") or name == "seq" else _plain(field, kinds)
        if plain is not None and "default" not in field:
            found[name] = plain
    return found


def _plain(field: Json, kinds: Json) -> Json | None:
    """The schema of a field in plain types; None where it has none."""
    if "$ref" in field:
        field = kinds[field["$ref"].rpartition("/")[2]]
    if "enum" in field:
        return TEXT
    kind: Any = field.get("type")
    if kind in PLAIN:
        return {"type": kind}
    if kind == "array" and isinstance(field.get("items"), dict):
        items = _plain(field["items"], kinds)
        return None if items is None or items["type"] == "array" else {"type": "array", "items": items}
    if kind == "object":
        return {"type": "object", "properties": _properties(field, kinds) if "properties" in field else {}}
    return None
