"""Numbers are noted when messages come, and gaps are kept until they close or are given up."""

from __future__ import annotations

from lsu_mesh_services.network.received_numbers import MAX_STREAMS, Number, ReceivedNumbers, as_ranges

from lsu_mesh.mesh.sequences import Head

BOOT, KEY = "0" * 16, "lsu/v1/demo/input/plant"
STREAM = (KEY, BOOT)


def take(numbers: ReceivedNumbers, *seqs: int, at: int = 0) -> list[bool]:
    return [numbers.take(KEY, Head(BOOT, seq, seq), at)[0] for seq in seqs]


def test_copies_are_not_let_in_and_holes_are_known_at_once() -> None:
    numbers = ReceivedNumbers()
    assert take(numbers, 5, 6, 9, 6, 8, 5, at=7) == [True, True, True, False, True, False]
    ((gap, missing),) = numbers.gaps()
    assert (gap.stream, gap.noticed_ns, missing, numbers.copies) == (STREAM, 7, [(7, 7)], 2)
    assert take(numbers, 7) == [True]
    assert numbers.gaps() == []


def test_what_is_given_up_is_let_in_if_it_comes_all_the_same() -> None:
    numbers = ReceivedNumbers()
    take(numbers, 0, 5)
    numbers.give_up(gap for gap, _ in numbers.gaps())
    assert numbers.gaps() == []
    assert take(numbers, 3, 3) == [True, False]


def test_another_message_under_a_known_number_is_left_to_admission() -> None:
    numbers = ReceivedNumbers()
    take(numbers, 0, 1, 2)
    assert numbers.take(KEY, Head(BOOT, 1, 99), 0) == (True, None)


def test_so_many_streams_and_no_more_are_watched() -> None:
    numbers = ReceivedNumbers()
    for one in range(MAX_STREAMS + 10):
        assert numbers.take(f"key/{one}", Head(BOOT, 0, 0), 0)[0]
    assert numbers.take("key/0", Head(BOOT, 0, 0), 0) == (False, None)
    assert numbers.take(f"key/{MAX_STREAMS + 5}", Head(BOOT, 0, 0), 0) == (True, None)


def test_what_is_dropped_one_by_one_is_one_gap() -> None:
    numbers = ReceivedNumbers()
    take(numbers, *range(100))
    for seq in range(50):
        numbers.want([Number(STREAM, seq)], seq * 1_000_000)
    assert [(gap.left, missing) for gap, missing in numbers.gaps()] == [(50, [(0, 49)])]


def test_numbers_become_ranges() -> None:
    other = ("key", BOOT)
    found = as_ranges([Number(STREAM, seq) for seq in (3, 1, 2, 7)] + [Number(other, 2)])
    assert found == [(STREAM, 1, 3), (STREAM, 7, 7), (other, 2, 2)]
