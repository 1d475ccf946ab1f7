"""What waits to be taken is bounded by number and by bytes, and what does not fit is counted."""

from __future__ import annotations

import threading

from lsu_mesh_services.network.receive_queue import Arrival, ReceiveQueue


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


def test_a_full_queue_drops_what_comes_and_counts_it() -> None:
    arrivals = ReceiveQueue(most=10)
    for number in range(25):
        arrivals.put(sample(3, number))
    assert arrivals.dropped == 15
    assert [arrival.arrival_ns for arrival in taken(arrivals)] == list(range(10)), "what has come stays"
    arrivals.put(sample(3, 99))
    assert [arrival.arrival_ns for arrival in taken(arrivals)] == [99], "there is room again"


def test_few_large_payloads_fill_the_queue_too() -> None:
    arrivals = ReceiveQueue(most_bytes=1000)
    for _ in range(3):
        for _ in range(10):
            arrivals.put(sample(400))
        assert len(taken(arrivals)) == 3
    assert arrivals.dropped == 21


def test_who_comes_and_goes_is_told_even_by_a_full_queue() -> None:
    arrivals = ReceiveQueue(most=1)
    arrivals.put(sample(3))
    arrivals.put(Arrival("gone", "live/s1", b"", 1))
    assert [arrival.what for arrival in taken(arrivals)] == ["sample", "gone"]


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
    assert (len(full), full.dropped) == (1, 1)
