"""What waits to be taken is bounded by number and by bytes, and what does not fit is counted."""

from __future__ import annotations

import threading

import pytest
from lsu_mesh_services.network.receive_queue import Arrival, ReceiveQueue
from lsu_mesh_services.network.standstill import SECOND_NS, Standstill

from lsu_mesh.mesh.lost_messages import Loss
from lsu_mesh.mesh.sequences import Head

BOOT = "0" * 16


def sample(size: int, number: int = 0) -> Arrival:
    return Arrival("sample", f"key/{number}", bytes(size), number)


def taken(arrivals: ReceiveQueue) -> list[Arrival]:
    found = []
    while (arrival := arrivals.next(0)) is not None:
        found.append(arrival)
    return found


def test_what_comes_is_taken_in_its_order() -> None:
    arrivals = ReceiveQueue()
    sent = [sample(3, number) for number in range(100)]
    for arrival in sent:
        arrivals.put(arrival)
    assert len(arrivals) == 100
    assert taken(arrivals) == sent
    assert (len(arrivals), arrivals.dropped) == (0, 0)
    assert arrivals.next(0.01) is None


def test_a_full_queue_drops_the_oldest_and_counts_it() -> None:
    arrivals = ReceiveQueue(most=10)
    for number in range(25):
        arrivals.put(sample(3, number))
    assert arrivals.dropped == 15
    assert [arrival.arrival_ns for arrival in taken(arrivals)] == list(range(15, 25)), "the newest stay"
    arrivals.put(sample(3, 99))
    assert [arrival.arrival_ns for arrival in taken(arrivals)] == [99], "there is room again"


def test_few_large_payloads_fill_the_queue_too() -> None:
    arrivals = ReceiveQueue(most_bytes=1000)
    for _ in range(3):
        for _ in range(10):
            arrivals.put(sample(400))
        assert len(taken(arrivals)) == 2
    assert arrivals.dropped == 24


def test_what_was_dropped_is_known_by_number_and_a_copy_of_what_waits_is_not_let_in() -> None:
    arrivals = ReceiveQueue(most=10)
    for seq in range(25):
        arrivals.put(sample(3, 0), Head(BOOT, seq, seq))
    ((gap, missing),) = arrivals.gaps()
    assert (gap.stream, missing) == (("key/0", BOOT), [(0, 14)])
    assert len(taken(arrivals)) == 10
    for seq in range(25):
        arrivals.put_answer(sample(3, 0), Head(BOOT, seq, seq))
    assert (arrivals.gaps(), arrivals.copies, len(taken(arrivals))) == ([(gap, [(10, 14)])], 10, 10)
    for seq in range(25):
        arrivals.put_answer(sample(3, 0), Head(BOOT, seq, seq))
    assert (arrivals.gaps(), arrivals.copies, len(taken(arrivals))) == ([], 30, 5)


def test_an_answer_drives_nothing_out_of_a_full_queue() -> None:
    arrivals = ReceiveQueue(most=3)
    for seq in (0, 1, 2, 3, 9):
        arrivals.put(sample(3, 0), Head(BOOT, seq, seq))
    arrivals.put_answer(Arrival("sample", "key/0", b"xyz", 77), Head(BOOT, 5, 5))
    assert [arrival.arrival_ns for arrival in taken(arrivals)] == [0, 0, 0]
    assert sorted(number for _, missing in arrivals.gaps() for a, b in missing for number in range(a, b + 1)) == [
        0, 1, 4, 5, 6, 7, 8,
    ]  # fmt: skip


def aged(ages: dict[str, list[float]], spared_s: float | None = 6.0) -> ReceiveQueue:
    """A queue at the time of 100 s with samples of so many seconds, by key; inputs are spared."""
    arrivals = ReceiveQueue()
    spared_ns = None if spared_s is None else int(spared_s * SECOND_NS)
    is_input = "input".__eq__
    arrivals.bound_age(6 * SECOND_NS, lambda: 100 * SECOND_NS, is_input, max_spared_ns=spared_ns)
    samples = sorted((100 - age, key, seq) for key, those in ages.items() for seq, age in enumerate(those))
    for at, key, seq in samples:
        arrivals.put(Arrival("sample", key, b"x", int(at * SECOND_NS)), Head(BOOT, seq, seq))
    return arrivals


def test_a_queue_whose_oldest_is_too_old_gives_up_all_behind_the_present_but_inputs() -> None:
    arrivals = aged({"data": [7.0, 5.0, 3.0, 0.2, 0.1], "input": [7.0, 5.0, 0.1]})
    found = [arrivals.next(0)]
    assert arrivals.is_late
    found += taken(arrivals)
    assert [(one.key, round(100 - one.arrival_ns / SECOND_NS, 3)) for one in found if one is not None] == [
        ("input", 5.0), ("data", 0.2), ("data", 0.1), ("input", 0.1),
    ]  # fmt: skip
    assert sorted(arrivals.take_losses()) == [Loss("data", BOOT, 0, 2, True), Loss("input", BOOT, 0, 0, True)]
    assert (arrivals.too_old, arrivals.dropped, arrivals.take_losses(), arrivals.gaps()) == (4, 0, [], [])
    assert not arrivals.is_late, "the queue was empty once"


def test_inputs_of_a_peer_that_cannot_do_without_them_are_never_too_old() -> None:
    arrivals = aged({"data": [30.0, 5.0, 0.2], "input": [31.0, 7.0, 0.1]}, spared_s=None)
    assert [one.key for one in taken(arrivals)] == ["input", "input", "data", "input"]
    assert arrivals.take_losses() == [Loss("data", BOOT, 0, 1, True)]


def test_a_queue_within_its_bound_gives_up_nothing() -> None:
    arrivals = aged({"data": [5.9, 3.0, 0.1], "input": [5.8]})
    assert len(taken(arrivals)) == 4
    assert (arrivals.too_old, arrivals.take_losses(), arrivals.is_late) == (0, [], False)


@pytest.mark.parametrize(("used_ns", "too_old"), [(0, 0), (8 * SECOND_NS, 2)], ids=["stopped", "busy"])
def test_what_waited_while_the_process_stood_still_waits_from_then_on(used_ns: int, too_old: int) -> None:
    """It may be stopped while it takes a message and while it uses one; a busy thread is not excused."""
    now, used = [100 * SECOND_NS], [0]
    arrivals = ReceiveQueue()
    arrivals.bound_age(6 * SECOND_NS, lambda: now[0], standstill=Standstill(lambda: used[0]))
    for seq in range(4):
        arrivals.put(Arrival("sample", "data", b"x", now[0]), Head(BOOT, seq, seq))
    assert arrivals.next(0) is not None
    assert arrivals.next(0) is not None
    now[0] += 9 * SECOND_NS
    used[0] += used_ns
    assert len(taken(arrivals)) == 2 - too_old
    assert arrivals.too_old == too_old


def test_who_came_long_ago_is_told_all_the_same() -> None:
    arrivals = aged({"data": [9.0]})
    arrivals.put(Arrival("gone", "live/s1", b"", 0))
    assert [one.what for one in taken(arrivals)] == ["gone"]
    assert arrivals.too_old == 1


def test_who_comes_and_goes_is_told_even_by_a_full_queue() -> None:
    arrivals = ReceiveQueue(most=1)
    arrivals.put(sample(3))
    arrivals.put(Arrival("gone", "live/s1", b"", 1))
    arrivals.put(sample(3))
    assert [arrival.what for arrival in taken(arrivals)] == ["gone"]
    assert arrivals.dropped == 2


def test_threads_that_put_at_once_lose_no_byte_of_the_account() -> None:
    arrivals = ReceiveQueue(most_bytes=10**9)

    def put() -> None:
        for _ in range(5000):
            arrivals.put(sample(100))

    threads = [threading.Thread(target=put) for _ in range(4)]
    for thread in threads:
        thread.start()
    count = 0
    while any(thread.is_alive() for thread in threads) or len(arrivals):
        count += arrivals.next(0.01) is not None
    assert count == 20_000
    full = ReceiveQueue(most_bytes=100)
    full.put(sample(100))
    full.put(sample(1))
    full.put(sample(99))
    assert (len(full), full.dropped) == (2, 1)


def test_a_peer_is_late_while_its_oldest_message_waits_for_long() -> None:
    for age, is_late in ((0.9, False), (1.1, True)):
        assert aged({"data": [age]}).waits_long() == is_late
    assert not aged({"data": []}).waits_long()
    assert not ReceiveQueue().waits_long(), "no age is bound, and none is known"
