"""Payloads of earlier versions are read for ever, to the values that they were written with."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack
import msgspec
import pytest

from lsu_mesh.mesh.messages import TYPES, decode, encode, read

DATA = Path(__file__).parent / "data"
FIRST = "payloads-0.1/first.jsonl"
"""Made before any field was added."""
NEWEST = "payloads-0.1/with-smoothing.jsonl"
LATER_TOPICS = {FIRST: {"smoothed"}, NEWEST: set()}


def kept(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def payloads() -> Iterator[Any]:
    for file in sorted(DATA.glob("payloads-*/*.jsonl")):
        for line in kept(file):
            yield pytest.param(line, id=f"{file.parent.name} {file.stem}: {line['name']}")


def default(topic: str, field: str) -> Any:
    """What a message has where its payload lacks the field."""
    found = next(one for one in msgspec.structs.fields(TYPES[topic]) if one.name == field)
    return found.default if found.default_factory is msgspec.NODEFAULT else found.default_factory()


@pytest.mark.parametrize("line", list(payloads()))
def test_a_released_payload_means_what_it_meant(line: dict[str, Any]) -> None:
    topic, fields, payload = line["topic"], line["fields"], bytes.fromhex(line["payload"])
    assert msgpack.unpackb(payload) == fields, "plain msgpack reads it"
    message, unknown = read(topic, payload)
    assert unknown == ()
    later = {name: default(topic, name) for name in TYPES[topic].__struct_fields__ if name not in fields}
    assert in_words(msgspec.to_builtins(message)) == in_words(fields | later)
    assert decode(topic, encode(message)) == message


def in_words(fields: dict[str, Any]) -> str:
    """All values to the last bit, the sign of zero too."""
    return json.dumps(fields, sort_keys=True)


@pytest.mark.parametrize("file", [FIRST, NEWEST])
def test_every_topic_and_set_of_a_version_is_kept(file: str) -> None:
    lines = kept(DATA / file)
    assert {line["topic"] for line in lines} == set(TYPES) - LATER_TOPICS[file]
    supports = [line["fields"]["support"] for line in lines if "support" in line["fields"]]
    assert {support["type"] for support in supports} == {
        "orthotope", "parallelotope", "zonotope", "constrained_zonotope", "intersection",
    }  # fmt: skip


def test_the_first_payloads_have_no_field_that_came_later() -> None:
    later = {"time_error_ns", "algorithm", "point_rule", "gain_of", "started_ns", "host", "mean", "covariance"}
    assert all(not later & set(line["fields"]) for line in kept(DATA / FIRST))


def test_the_newest_payloads_have_every_field_of_today() -> None:
    """Where this fails, a field was added: keep the payloads of today too, with ``write_payloads.py``."""
    for topic, kind in TYPES.items():
        written = [set(line["fields"]) for line in kept(DATA / NEWEST) if line["topic"] == topic]
        assert written
        assert all(fields == set(kind.__struct_fields__) for fields in written)
