"""Up to the flushed number nothing is missing, whatever order things come in."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lsu_mesh.mesh.ledger import WINDOW, Ledger

A, B = "a" * 16, "b" * 16


@given(st.lists(st.integers(0, 40), min_size=1, max_size=80))
def test_everything_from_the_first_to_the_flushed_number_has_come(numbers: list[int]) -> None:
    ledger = Ledger()
    for count, number in enumerate(numbers, start=1):
        ledger.record("key", A, number)
        ledger.flush()
        expected = numbers[0]
        while expected + 1 in numbers[:count]:
            expected += 1
        assert ledger.flushed == {"key": expected}
        assert ledger.lost("key") == []


def test_nothing_is_flushed_before_it_is_flushed() -> None:
    ledger = Ledger()
    ledger.record("key", A, 0)
    assert ledger.flushed == {}
    ledger.flush()
    ledger.record("key", A, 1)
    assert ledger.flushed == {"key": 0}


def test_a_number_that_never_comes_is_given_up_and_counted() -> None:
    ledger = Ledger()
    ledger.record("key", A, 0)
    for number in range(2, WINDOW + 3):
        ledger.record("key", A, number)
    ledger.flush()
    assert ledger.flushed == {"key": WINDOW + 2}
    assert ledger.lost("key") == [(1, 1)]
    assert ledger.is_lost("key", 1)


def test_a_monstrous_number_costs_nothing() -> None:
    ledger = Ledger()
    for number in (0, 2**62, 5, 2**63 - 1):
        ledger.record("key", A, number)
    ledger.flush()
    assert ledger.flushed == {"key": 2**63 - 1}
    assert ledger.lost("key") == [(1, 2**62 - 1), (2**62 + 1, 2**63 - 2)]


def test_a_new_life_counts_anew_and_stragglers_of_the_old_one_change_nothing() -> None:
    ledger = Ledger()
    ledger.record("key", A, 7)
    ledger.record("key", B, 0)
    ledger.record("key", A, 8)
    ledger.record("key", B, 1)
    ledger.flush()
    assert (ledger.flushed, ledger.boot("key"), ledger.first("key")) == ({"key": 1}, B, 0)


def test_what_is_told_between_two_flushes_belongs_to_the_boot_that_was_flushed() -> None:
    ledger = Ledger()
    ledger.record("key", A, 7)
    ledger.flush()
    ledger.record("key", B, 2)
    assert (ledger.flushed, ledger.boot("key"), ledger.first("key")) == ({"key": 7}, A, 7)
    ledger.flush()
    assert (ledger.flushed, ledger.boot("key"), ledger.first("key")) == ({"key": 2}, B, 2)
