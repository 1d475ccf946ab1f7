"""A field that is not known here is ignored and counted, wherever it stands, and nothing is believed of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh.mesh import messages
from lsu_mesh.mesh.message_examples import example
from lsu_mesh.mesh.messages import TYPES, Posterior, Refused, decode, encode, read
from lsu_mesh.mesh.unknown_fields import MAX_NAME, MAX_UNKNOWN

KEPT = sorted((Path(__file__).parent / "data").glob("payloads-*/*.jsonl"))
FREE = {"counters", "about", "r"}
"""Maps whose keys are data."""
value = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=5) | st.binary(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


def kept() -> list[Any]:
    """Payloads of every topic and set, of all versions."""
    lines = [json.loads(line) for file in KEPT for line in file.read_text(encoding="utf-8").splitlines()]
    return [pytest.param(line["topic"], bytes.fromhex(line["payload"]), id=line["name"]) for line in lines]


def maps(content: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every map in a message that has fields, and where it stands."""
    if isinstance(content, dict):
        yield path, content
        for name, inner in content.items():
            if name not in FREE:
                yield from maps(inner, f"{path}{name}.")
    elif isinstance(content, list):
        for inner in content:
            yield from maps(inner, path)


def plain(topic: str) -> dict[str, Any]:
    fields: dict[str, Any] = msgpack.unpackb(encode(example(topic)))
    return fields


@pytest.mark.parametrize(("topic", "payload"), kept())
def test_a_further_field_in_any_map_of_any_message_is_ignored_and_named(topic: str, payload: bytes) -> None:
    message = decode(topic, payload)
    fields = msgpack.unpackb(payload)
    places = list(maps(fields))
    for path, place in places:
        place["colour"] = {"type": "zonotope", "lower": [1.0]}
        found, unknown = read(topic, msgpack.packb(fields))
        assert found == message
        assert unknown == (f"{path}colour",)
        del place["colour"]
    for _, place in places:
        place["colour"] = None
    found, unknown = read(topic, msgpack.packb(fields))
    assert found == message
    assert sorted(unknown) == sorted({f"{path}colour" for path, _ in places})


@settings(max_examples=100, deadline=None)
@given(data=st.data(), topic=st.sampled_from(sorted(TYPES)))
def test_whatever_an_unknown_field_holds_the_message_is_the_same(data: st.DataObject, topic: str) -> None:
    fields = plain(topic)
    names = data.draw(st.lists(st.text(max_size=8), min_size=1, max_size=4, unique=True))
    added = {name: data.draw(value) for name in names if name not in fields}
    order = data.draw(st.permutations([*fields.items(), *added.items()]))
    message, unknown = read(topic, msgpack.packb(dict(order)))
    assert message == example(topic)
    assert len(unknown) <= len(added)
    assert bool(unknown) == bool(added)


def test_fields_that_came_later_may_be_missing_where_others_are_unknown() -> None:
    fields = plain("posterior")
    for name in ("cause", "descent", "gain", "gain_of", "point_rule", "algorithm"):
        del fields[name]
    before = len(fields)
    fields |= {f"new {number}": number for number in range(6)}
    assert len(fields) == before + 6 == len(TYPES["posterior"].__struct_fields__), "as long as a message of today"
    message, unknown = read("posterior", msgpack.packb(fields))
    assert unknown == tuple(f"new {number}" for number in range(6))
    assert isinstance(message, Posterior)
    assert (message.algorithm, message.point_rule, message.descent) == (None, None, [])


@pytest.mark.parametrize(
    ("change", "reason", "words"),
    [
        ({"support": {"type": "sphere", "radius": 1.0}}, "content", "sphere"),
        ({"support": {"radius": 1.0}}, "content", "type"),
        ({"support": {"type": 7, "radius": 1.0}}, "content", r"support"),
        ({"support": {"type": "orthotope", "centre": [0.0, 0.0], "radius": [1.0, 1.0]}}, "content", "lower"),
        ({"lower": [2.0, 0.0]}, "content", "lower > upper"),
        ({"base": "somewhere"}, "content", "somewhere"),
        ({"bounds": {"rho": [-0.1], "r": [], "colour": 1}}, "content", "negative"),
        ({"v": 2}, "version", "version 2, this peer speaks 1"),
    ],
)
def test_what_is_wrong_stays_refused_beside_an_unknown_field(change: dict[str, Any], reason: str, words: str) -> None:
    with pytest.raises(Refused, match=words) as caught:
        decode("posterior", msgpack.packb(plain("posterior") | change | {"colour": 1}))
    assert caught.value.reason == reason


def test_another_version_is_refused_as_such_whatever_its_fields_are() -> None:
    with pytest.raises(Refused, match="version 2") as caught:
        decode("posterior", msgpack.packb({"sets": [1, 2], "v": 2, "support": "none"}))
    assert caught.value.reason == "version"


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"\x82\xa1v\x01\xa1z" + b"\x91" * 100_000, "format"),
        (b"\x82\xa1v\x01\xa1z\xdd\xff\xff\xff\xff", "format"),
        (b"\x82\xa1v\x01\xa1z\xc1", "format"),
        (b"\x82\xa1v\x01\xa1\xff\x01", "format"),
        (b"\x82\xa1v\x01\x07\x01", "content"),
        (b"\x82\xa1v\x01\xa1z\x01\x01", "format"),
        (b"\xdf\x00\x05\x00\x00\xa1v\x01" + b"\xa1z\x01" * (0x50000 - 1), "content"),
        (b"\x82\xa1v\x01\xa1z\xdd\x00\x0f\x00\x00" + b"\x80" * 0xF0000, "content"),
        (b"\x82\xa1v\x01\xa8rejected\xdd\x00\x0f\x00\x00" + b"\x80" * 0xF0000, "content"),
    ],
    ids=["deep", "cut", "no value", "no text", "number as name", "more behind", "many", "large", "long list of maps"],
)
def test_monstrous_unknown_fields_are_refused(payload: bytes, reason: str) -> None:
    with pytest.raises(Refused) as caught:
        decode("fused", payload)
    assert caught.value.reason == reason


def test_a_large_unknown_field_is_skipped_and_a_message_of_unknown_fields_is_none() -> None:
    fields = plain("measurement")
    large = msgpack.packb(fields | {"image": [[0.5] * 100] * 1000})
    assert read("measurement", large) == (example("measurement"), ("image",))
    many = {f"f{number}": 0 for number in range(MAX_UNKNOWN - 1)}
    assert len(read("measurement", msgpack.packb(fields | many))[1]) == MAX_UNKNOWN - 1
    with pytest.raises(Refused, match="unknown fields"):
        decode("measurement", msgpack.packb(fields | {f"f{number}": 0 for number in range(2 * MAX_UNKNOWN)}))


def test_a_name_is_told_without_control_characters_and_not_at_length() -> None:
    _, unknown = read("truth", msgpack.packb(plain("truth") | {"\x1b[2Jx\n": 1, "y" * 4000: 1}))
    assert unknown == ("?[2Jx?", "y" * MAX_NAME)


@pytest.mark.parametrize(("topic", "payload"), kept())
def test_messages_without_unknown_fields_are_decoded_once(
    topic: str, payload: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    def looked_at_again(*_: object) -> None:
        raise AssertionError("strict decoding is enough")

    monkeypatch.setattr(messages, "_read_newer", looked_at_again)
    assert read(topic, payload)[1] == ()
