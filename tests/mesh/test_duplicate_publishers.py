"""Two living processes of one key: proved by interleaving, the later one refused until the earlier one is gone."""

from __future__ import annotations

from typing import Any

import pytest

from lsu_mesh.mesh.admission import DUPLICATE_PUBLISHER, Admission
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.duplicate_publishers import MAX_BOOTS, DuplicatePublishers
from lsu_mesh.mesh.messages import Event, Health, Measurement, encode

S = 10**9
KEY = "lsu/v1/demo/measurement/s1"
A, B, C = "a" * 16, "b" * 16, "c" * 16


@pytest.fixture(scope="module")
def configuration(demo: Any) -> Configuration:
    return load(demo)


class Receiver:
    """One receiver of sensor s1; times in seconds."""

    def __init__(self, configuration: Configuration) -> None:
        self.digest = configuration.digest()
        self.admission = Admission(configuration, ["measurement", "health", "event"])
        self.publishers = self.admission.publishers = DuplicatePublishers(kept=64)

    def gets(self, boot: str, seq: int, at: float, sent: float | None = None) -> bool:
        """Whether a measurement that arrives at a time is let in; sent at the same time unless said."""
        sent_ns = int((at if sent is None else sent) * S)
        message = Measurement(
            v=1, src="sensor/s1", boot=boot, seq=seq, step=1 + seq, sent_ns=sent_ns, origin_ns=sent_ns,
            model=self.digest, y=[0.5], time_ns=0,
        )  # fmt: skip
        return self.admission.admit(KEY, encode(message), int(at * S)) is not None

    def twins(self, at: float) -> list[tuple[str, str]]:
        """``(used, refused)`` boots."""
        return [(pair.used, pair.refused) for pair in self.publishers.present(int(at * S))]


@pytest.fixture
def receiver(configuration: Configuration) -> Receiver:
    return Receiver(configuration)


def interleaved(receiver: Receiver, first: str, second: str, until: float, begin: float = 100.0) -> dict[str, int]:
    """How many of each boot's messages were let in, both at 10 Hz, the second a twentieth of a second later."""
    admitted = {first: 0, second: 0}
    for k in range(round((until - begin) * 10)):
        admitted[first] += receiver.gets(first, k, begin + 0.1 * k)
        admitted[second] += receiver.gets(second, k, begin + 0.1 * k + 0.05)
    return admitted


@pytest.mark.parametrize(("first", "second"), [(A, B), (B, A)])
def test_of_two_that_interleave_the_one_that_came_first_is_used(receiver: Receiver, first: str, second: str) -> None:
    assert interleaved(receiver, first, second, until=105.0) == {first: 50, second: 1}
    assert receiver.admission.refused == {DUPLICATE_PUBLISHER: 49}
    assert receiver.twins(105.0) == [(first, second)]
    assert [(pair.used, pair.refused) for pair in receiver.publishers.take_news()] == [(first, second)], "told once"
    assert "sensor/s1" in receiver.admission.last_refusal


def test_a_restart_is_used_from_its_first_message_on(receiver: Receiver) -> None:
    for k in range(20):
        assert receiver.gets(A, k, 100 + 0.1 * k)
    for k in range(50):
        assert receiver.gets(B, k, 102.0 + 0.1 * k)
    assert receiver.twins(102.5) == []
    assert not receiver.publishers.take_news()


def test_many_restarts_one_after_another_are_all_used(receiver: Receiver) -> None:
    for life in range(5 * MAX_BOOTS):
        for k in range(5):
            assert receiver.gets(f"{life:016x}", k, 100 + life + 0.1 * k)
    assert not receiver.publishers.take_news()


def test_what_was_under_way_when_a_process_ended_proves_nothing(receiver: Receiver) -> None:
    """The last messages of A arrive late, out of order, among the first ones of B."""
    for k in range(20):
        assert receiver.gets(A, k, 100 + 0.1 * k)
    for k in range(20):
        assert receiver.gets(B, k, 103.0 + 0.1 * k)
        assert receiver.gets(A, 39 - k, 103.05 + 0.1 * k, sent=102.0 + 0.01 * (20 - k))
    assert not receiver.publishers.take_news()
    assert all(receiver.gets(B, k, 103.0 + 0.1 * k) for k in range(20, 40))


def test_a_receiver_that_first_hears_the_successor_takes_late_messages_for_no_second_process(
    receiver: Receiver,
) -> None:
    for k in range(10):
        assert receiver.gets(B, k, 103.0 + 0.1 * k)
    assert receiver.gets(A, 7, 104.0, sent=101.0)
    assert receiver.gets(A, 8, 104.0, sent=101.1)
    assert all(receiver.gets(B, k, 103.1 + 0.1 * k) for k in range(10, 60))
    assert not receiver.publishers.take_news()


def test_a_recovered_backlog_of_the_one_that_lives_is_used(receiver: Receiver) -> None:
    interleaved(receiver, A, B, until=101.0)
    assert receiver.gets(A, 30, 103.0)
    assert all(receiver.gets(A, k, 103.1, sent=100 + 0.1 * k) for k in range(12, 30))
    assert not receiver.gets(B, 12, 103.2, sent=101.2)


def test_the_later_one_is_used_when_the_earlier_one_is_killed_and_what_was_missed_since_is_wanted(
    receiver: Receiver,
) -> None:
    interleaved(receiver, A, B, until=105.0)
    admitted = [k for k in range(50, 150) if receiver.gets(B, k, 100.05 + 0.1 * k)]
    assert admitted[0] == 79, "3 s after the last message of A"
    assert admitted == list(range(79, 150)), "and it is used from then on"
    assert receiver.admission.gaps_by_key() == {KEY: 30}, "what came after the last message of A, once more"
    assert all(receiver.gets(B, k, 115.0, sent=100.05 + 0.1 * k) for k in range(49, 79))
    assert receiver.admission.gaps == 0
    assert receiver.twins(115.0) == []


def test_the_token_says_at_once_that_the_earlier_one_is_gone(receiver: Receiver) -> None:
    interleaved(receiver, A, B, until=105.0)
    receiver.publishers.record_alive("s1", False, int(105.0 * S))
    assert receiver.gets(B, 50, 105.05)
    assert receiver.twins(105.1) == []


def test_a_token_that_goes_while_both_live_changes_nothing_for_long(receiver: Receiver) -> None:
    interleaved(receiver, A, B, until=105.0)
    receiver.publishers.record_alive("s1", False, int(105.0 * S))
    used = {A: 0, B: 0}
    for k in range(50, 100):
        used[A] += receiver.gets(A, k, 100 + 0.1 * k + 0.01)
        used[B] += receiver.gets(B, k, 100 + 0.1 * k + 0.05)
    assert used == {A: 50, B: 1}
    assert receiver.twins(110.0) == [(A, B)]


def test_one_that_was_frozen_is_the_later_one_when_it_comes_back(receiver: Receiver) -> None:
    interleaved(receiver, A, B, until=105.0)
    assert [receiver.gets(B, k, 100.05 + 0.1 * k) for k in range(50, 100)].count(True) == 21
    receiver.publishers.take_news()
    used = {A: 0, B: 0}
    for k in range(50):
        used[A] += receiver.gets(A, 50 + k, 110.1 + 0.1 * k)
        used[B] += receiver.gets(B, 100 + k, 110.15 + 0.1 * k)
    assert used == {A: 1, B: 50}
    assert [(pair.used, pair.refused) for pair in receiver.publishers.take_news()] == [(B, A)]


def test_one_that_was_replaced_while_it_was_frozen_is_the_later_one_when_it_comes_back(receiver: Receiver) -> None:
    for k in range(20):
        assert receiver.gets(A, k, 100 + 0.1 * k)
    assert all(receiver.gets(B, k, 103 + 0.1 * k) for k in range(100))
    used = {A: 0, B: 0}
    for k in range(50):
        used[A] += receiver.gets(A, 20 + k, 112.99 + 0.1 * k)
        used[B] += receiver.gets(B, 100 + k, 113 + 0.1 * k)
    assert used == {A: 1, B: 50}
    assert receiver.twins(118.0) == [(B, A)]


def test_slow_publishers_are_given_three_of_their_gaps(receiver: Receiver) -> None:
    for k in range(6):
        assert receiver.gets(A, k, 100 + 10.0 * k)
        receiver.gets(B, k, 105 + 10.0 * k)
    assert [receiver.gets(B, k, 105 + 10.0 * k) for k in range(6, 10)] == [False, False, True, True], "last A at 150"


@pytest.mark.parametrize("offset", [-3600.0, 3600.0])
def test_clocks_of_two_hosts_that_differ_hide_no_second_process(receiver: Receiver, offset: float) -> None:
    used = {A: 0, B: 0}
    for k in range(50):
        used[A] += receiver.gets(A, k, 10_000 + 0.1 * k)
        used[B] += receiver.gets(B, k, 10_000.05 + 0.1 * k, sent=10_000.05 + offset + 0.1 * k)
    assert used[A] == 50
    assert used[B] <= 12, "about a second"
    assert receiver.twins(10_005.0) == [(A, B)]


def test_of_three_the_first_that_lives_is_used(receiver: Receiver) -> None:
    used = dict.fromkeys((A, B, C), 0)
    for k in range(100):
        for i, boot in enumerate((A, B, C)):
            if boot != A or k < 30:
                used[boot] += receiver.gets(boot, k, 100 + 0.1 * k + 0.03 * i)
    assert used[A] == 30
    assert used[B] == 1 + 41, "from 3 s after A's last on"
    assert used[C] == 1
    assert receiver.twins(110.0) == [(B, C)]


def test_watchers_read_health_and_events_of_both(receiver: Receiver) -> None:
    for k in range(10):
        for boot in (A, B):
            common = {
                "v": 1, "src": "sensor/s1", "boot": boot, "seq": k, "step": 1, "sent_ns": (100 + k) * S,
                "origin_ns": 1, "model": receiver.digest,
            }  # fmt: skip
            health = Health(**common, role="sensor", level="OK", reasons=[], counters={})
            event = Event(**common, level="INFO", code="x", text="x", about={})
            for message in (health, event):
                address = f"lsu/v1/demo/{message.topic}/s1"
                assert receiver.admission.admit(address, encode(message), (100 + k) * S) is not None


def test_memory_stays_bounded_whatever_boots_come(receiver: Receiver) -> None:
    for k in range(2000):
        receiver.gets(f"{k % 500:016x}", k, 100 + 0.001 * k)
    (known,) = receiver.publishers._known.values()
    assert len(known) <= MAX_BOOTS
    assert all(len(one.rivals) + len(one.sent_beside) + len(one.heard_beside) <= 3 * MAX_BOOTS for one in known)
    assert len(receiver.publishers._news) <= 64


def test_without_times_of_arrival_nothing_is_refused(configuration: Configuration) -> None:
    receiver = Receiver(configuration)
    for k in range(10):
        for boot in (A, B):
            message = Measurement(
                v=1, src="sensor/s1", boot=boot, seq=k, step=1 + k, sent_ns=k, origin_ns=k, model=receiver.digest,
                y=[0.5], time_ns=0,
            )  # fmt: skip
            assert receiver.admission.admit(KEY, encode(message)) is not None
