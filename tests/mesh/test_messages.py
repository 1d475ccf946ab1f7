"""Messages: what goes in comes out, and nothing else gets in."""

from __future__ import annotations

import math
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lsu_mesh.mesh.messages import (
    MAX_PAYLOAD,
    TYPES,
    Measurement,
    Posterior,
    Refused,
    decode,
    encode,
)

COMMON: dict[str, Any] = {
    "v": 1, "src": "filter/a", "boot": "0123456789abcdef", "seq": 3, "step": 2, "sent_ns": 10, "origin_ns": 9,
    "model": "m",
}  # fmt: skip
BOX = {"type": "orthotope", "lower": [0.0, -1.0], "upper": [1.0, 1.0]}
POSTERIOR: dict[str, Any] = COMMON | {
    "kind": "LSUO", "support": BOX, "lower": [0.0, -1.0], "upper": [1.0, 1.0], "point": [0.5, 0.0], "log_volume": None,
    "volume_of": "support", "status": "ok", "revision": 0, "epoch": 0, "guarantee": "declared", "base": "prior",
    "used": [["measurement", "sensor/s", "0123456789abcdef", 7]], "bounds": {"rho": [0.1, 0.1], "r": [0.2]},
    "missing": [], "cause": None, "descent": [], "gain": None, "gain_of": None, "point_rule": None, "algorithm": None,
    "mean": None, "covariance": None,
}  # fmt: skip

numbers = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(st.none() | numbers, max_size=5), st.integers(0, 2**63 - 1), st.integers(0, 2**63 - 1))
def test_a_measurement_comes_back_bit_by_bit(y: list[float | None], seq: int, step: int) -> None:
    message = Measurement(**(COMMON | {"src": "sensor/s", "seq": seq, "step": step}), y=y, time_ns=5)
    assert decode("measurement", encode(message)) == message


def test_a_posterior_written_by_plain_msgpack_is_understood() -> None:
    message = decode("posterior", msgpack.packb(POSTERIOR))
    assert isinstance(message, Posterior)
    assert message.used == [("measurement", "sensor/s", "0123456789abcdef", 7)]
    assert msgpack.unpackb(encode(message)) == POSTERIOR


@pytest.mark.parametrize(
    ("change", "reason", "words"),
    [
        ({"v": 2}, "version", "version 2"),
        ({"lower": [2.0, -1.0]}, "content", "lower > upper"),
        ({"upper": [math.nan, 1.0]}, "content", "not finite"),
        ({"upper": [math.inf, 1.0]}, "content", "not finite"),
        ({"point": [0.5]}, "content", "point has 1"),
        ({"support": BOX | {"lower": [0.0], "upper": [1.0]}}, "content", "dimension 1"),
        ({"support": {"type": "sphere"}}, "content", "sphere"),
        (
            {"support": {"type": "parallelotope", "center": [0.0, 0.0], "generators": [[1.0], [0.0]]}},
            "content",
            "row of 1",
        ),
        ({"support": {"type": "zonotope", "center": [0.0, 0.0], "generators": [[1.0]]}}, "content", "1 rows"),
        ({"bounds": {"rho": [-0.1], "r": []}}, "content", "negative"),
        ({"status": "fine"}, "content", "fine"),
        ({"base": "somewhere"}, "content", "somewhere"),
        ({"boot": "xyz"}, "content", "boot"),
        ({"seq": -1}, "content", "seq"),
        ({"step": 1.5}, "content", "step"),
        ({"lower": "low"}, "content", "lower"),
    ],
)
def test_a_malformed_posterior_is_refused_with_the_reason(change: dict[str, Any], reason: str, words: str) -> None:
    with pytest.raises(Refused, match=words) as caught:
        decode("posterior", msgpack.packb(POSTERIOR | change))
    assert caught.value.reason == reason


LATER = {"cause", "descent", "gain", "gain_of", "point_rule", "algorithm", "mean", "covariance"}


@pytest.mark.parametrize("missing", sorted(set(POSTERIOR) - LATER))
def test_every_field_of_a_posterior_without_a_default_is_needed(missing: str) -> None:
    content = {name: value for name, value in POSTERIOR.items() if name != missing}
    with pytest.raises(Refused, match=missing):
        decode("posterior", msgpack.packb(content))


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"\xc1",
        b"\x93\x01",
        b"\xdd\xff\xff\xff\xff",
        b"\x91" * 5000,
        b"\x81" * 5000,
        b"hello",
        b"\xdf\xff\xff\xff\xff",
    ],
)
def test_garbage_is_refused_in_every_topic(payload: bytes) -> None:
    for topic in TYPES:
        with pytest.raises(Refused):
            decode(topic, payload)


def test_a_payload_over_the_limit_is_not_looked_at() -> None:
    with pytest.raises(Refused, match="limit") as caught:
        decode("posterior", b"\x00" * (MAX_PAYLOAD + 1))
    assert caught.value.reason == "size"


@given(st.binary(max_size=300), st.sampled_from(sorted(TYPES)))
def test_random_bytes_raise_refused_and_nothing_else(payload: bytes, topic: str) -> None:
    with pytest.raises(Refused):
        decode(topic, payload)
