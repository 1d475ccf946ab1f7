"""Numbers pass once, and those that are missing are counted exactly, whatever comes."""

from __future__ import annotations

from itertools import pairwise

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lsu_mesh.mesh.message_examples import example
from lsu_mesh.mesh.messages import MAX_PAYLOAD, TYPES, Refused, encode
from lsu_mesh.mesh.sequences import MAX_RANGES, Head, Ranges, Sequence, read_head


@given(st.permutations(range(30)), st.lists(st.integers(0, 29), max_size=10))
def test_each_number_passes_exactly_once_in_any_order(order: list[int], copies: list[int]) -> None:
    sequence = Sequence(order[0])
    admitted = [seq for seq in [*order, *copies] if sequence.admit(seq)]
    assert sorted(admitted) == list(range(30))
    assert sequence.gaps == 0


def test_gaps_are_counted_until_they_are_filled() -> None:
    sequence = Sequence(5)
    assert sequence.admit(5)
    assert sequence.admit(9)
    assert sequence.gaps == 3
    assert sequence.admit(7)
    assert sequence.gaps == 2
    assert sequence.admit(2), "older than the first that came, but never seen"
    assert sequence.gaps == 2


def test_a_hole_is_counted_however_large_it_is() -> None:
    sequence = Sequence(0)
    sequence.admit(0)
    sequence.admit(42_470)
    assert sequence.gaps == 42_469
    assert sequence.admit(1), "the first of them may still come"
    assert sequence.gaps == 42_468


def test_memory_stays_bounded_and_the_count_exact_whatever_numbers_come() -> None:
    sequence = Sequence(0)
    count = 3 * MAX_RANGES
    for seq in range(0, 2**40 * count, 2**40):
        sequence.admit(seq)
    assert len(sequence.missing) <= MAX_RANGES
    assert sequence.gaps == (count - 1) * (2**40 - 1)


def test_a_number_that_comes_again_in_a_later_message_is_refused() -> None:
    sequence = Sequence(0)
    for seq in range(5):
        assert sequence.admit(seq, sent_ns=seq)
    assert not sequence.admit(3, sent_ns=3)
    with pytest.raises(Refused, match="came before"):
        sequence.admit(3, sent_ns=99)


numbers = st.tuples(st.integers(0, 60), st.integers(0, 12))


@given(st.lists(st.tuples(st.booleans(), numbers), max_size=40), numbers)
def test_ranges_are_a_set_of_numbers(changes: list[tuple[bool, tuple[int, int]]], part: tuple[int, int]) -> None:
    ranges, oracle = Ranges(), set[int]()
    for is_added, (first, size) in changes:
        if is_added:
            ranges.add(first, first + size)
            oracle |= set(range(first, first + size + 1))
        else:
            assert ranges.remove(first) == (first in oracle)
            oracle.discard(first)
    assert ranges.count == len(oracle)
    assert {number for number in range(80) if number in ranges} == oracle
    first, last = part[0], part[0] + part[1]
    found = ranges.within(first, last)
    assert [n for a, b in found for n in range(a, b + 1)] == sorted(n for n in oracle if first <= n <= last)
    assert all(b + 1 < a for (_, b), (a, _) in pairwise(found)), "no two touch"
    if oracle:
        assert ranges.drop_oldest() >= 1
        assert min(oracle) not in ranges


@pytest.mark.parametrize("topic", TYPES)
def test_the_head_of_every_message_is_read(topic: str) -> None:
    message = example(topic)
    assert read_head(encode(message)) == Head(message.boot, message.seq, message.sent_ns)


@pytest.mark.parametrize(
    "payload",
    [
        b"", b"\xc1", b"\x93\x01\x02\x03", b"\x91" * 5000, bytes(MAX_PAYLOAD + 1),
        msgpack.packb({"boot": "0" * 16, "seq": -1, "sent_ns": 0}),
        msgpack.packb({"boot": "0" * 16, "seq": 2**63, "sent_ns": 0}),
        msgpack.packb({"boot": "0" * 15, "seq": 0, "sent_ns": 0}),
        msgpack.packb({"boot": "0" * 16, "seq": "0", "sent_ns": 0}),
        msgpack.packb({"seq": 0, "sent_ns": 0}),
    ],
)  # fmt: skip
def test_what_has_no_head_is_left_to_admission(payload: bytes) -> None:
    assert read_head(payload) is None
