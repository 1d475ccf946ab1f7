"""Messages of banks: plain MessagePack with binary arrays, and strict reading of them."""

from __future__ import annotations

import struct
from typing import Any

import msgpack
import numpy as np
import pytest

from lsu_mesh.mesh.bank_messages import BANK_TYPES, MAX_BANK_PAYLOAD, packed, read_any
from lsu_mesh.mesh.message_examples import bank_example
from lsu_mesh.mesh.messages import Refused, encode

NAN, INF = struct.pack("<d", np.nan), struct.pack("<d", np.inf)


def plain(topic: str, **changes: Any) -> bytes:
    """A message as another client writes it, with some fields changed."""
    return bytes(msgpack.packb(msgpack.unpackb(encode(bank_example(topic))) | changes))


def reason(topic: str, payload: bytes) -> str:
    """Why a payload is refused."""
    with pytest.raises(Refused) as found:
        read_any(topic, payload)
    return found.value.reason


@pytest.mark.parametrize("topic", sorted(BANK_TYPES))
def test_plain_msgpack_reads_what_we_write_and_we_read_what_it_writes(topic: str) -> None:
    message = bank_example(topic)
    content = msgpack.unpackb(encode(message))
    assert set(content) == set(BANK_TYPES[topic].__struct_fields__)
    assert read_any(topic, plain(topic)) == (message, ())


def test_an_array_is_rows_of_little_endian_doubles() -> None:
    message = bank_example("bank_truth")
    rows = [struct.unpack_from("<2d", msgpack.unpackb(encode(message))["x"], 16 * i) for i in range(2)]
    assert message.matrix("x").tolist() == [list(row) for row in rows]
    assert packed(np.array([[1.0, 2.0], [3.0, 4.0]]).T) == struct.pack("<4d", 1.0, 3.0, 2.0, 4.0)


def test_a_newer_field_is_ignored_and_named() -> None:
    assert read_any("bank_truth", plain("bank_truth", colour="red"))[1] == ("colour",)


@pytest.mark.parametrize(
    ("topic", "changes"),
    [
        ("bank_truth", {"instances": 0}),
        ("bank_truth", {"instances": 3}),
        ("bank_truth", {"instances": 100_001}),
        ("bank_truth", {"x": NAN * 4}),
        ("bank_truth", {"x": [0.0, 1.0, 2.0, 3.0]}),
        ("bank_truth", {"x": b"\0" * 31}),
        ("bank_measurement", {"y": INF * 2}),
        ("bank_measurement", {"y": b"\0" * 15}),
        ("bank_posterior", {"lower": NAN * 4}),
        ("bank_posterior", {"lower": struct.pack("<4d", 9.0, 9.0, 9.0, 9.0)}),
        ("bank_posterior", {"point": b"\0" * 16}),
        ("bank_posterior", {"statuses": b"\0"}),
        ("bank_posterior", {"statuses": b"\0\x04"}),
        ("bank_posterior", {"log_volume": INF * 2}),
        ("bank_posterior", {"log_volume": b"\0" * 8}),
        ("bank_posterior", {"support": "parallelotope"}),
        ("bank_posterior", {"support": "parallelotope", "center": b"\0" * 32, "generators": b"\0" * 32}),
        ("bank_posterior", {"center": b"\0" * 32}),
        ("bank_posterior", {"boot": "x"}),
        ("bank_fused", {"upper": b""}),
    ],
)
def test_what_is_not_sound_is_refused(topic: str, changes: dict[str, Any]) -> None:
    assert reason(topic, plain(topic, **changes)) == "content"


def test_other_refusals_have_their_own_reasons() -> None:
    assert reason("bank_truth", b"\xc1") == "format"
    assert reason("bank_truth", plain("bank_truth", v=2)) in ("version", "content")
    assert reason("bank_truth", b"\0" * (MAX_BANK_PAYLOAD + 1)) == "size"
    assert reason("nonsense", b"") == "topic"
