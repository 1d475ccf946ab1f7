"""Gaps that the subscriber's own recovery leaves open are asked for again."""

from __future__ import annotations

import itertools
import time
from pathlib import Path

import pytest
from lsu_mesh_services.network.gap_recovery import (
    LOOK_NS,
    MAX_QUESTIONS,
    MAX_TRIES,
    SECOND_NS,
    WHOLE_CACHE,
    GapRecovery,
    RecoveryThread,
    joined,
)
from lsu_mesh_services.network.receive_queue import Arrival, ReceiveQueue

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.lost_messages import Loss
from lsu_mesh.mesh.messages import VERSION, Input, encode, encoding
from lsu_mesh.mesh.sequences import Head

INPUT, BOOT = key("demo", "input", "plant"), "0" * 16


@pytest.fixture(scope="module")
def configuration(demo: Path) -> Configuration:
    return load(demo)


def payload(configuration: Configuration, seq: int) -> bytes:
    return encode(
        Input(
            v=VERSION, src="plant/plant", boot="0" * 16, seq=seq, step=seq + 1, sent_ns=1, origin_ns=1,
            model=configuration.digest(), u=[0.5],
        )
    )  # fmt: skip


Asked = list[tuple[str, tuple[int, int] | None]]


def came(queue: ReceiveQueue, *numbers: int, at: int = 0, boot: str = BOOT) -> None:
    for seq in numbers:
        queue.put(Arrival("sample", INPUT, b"x", at), Head(boot, seq, seq))


def recovery_of(queue: ReceiveQueue, kept_ns: int | None = None) -> tuple[GapRecovery, Asked]:
    asked: Asked = []
    return GapRecovery(queue, lambda key, span: asked.append((key, span)), lambda _: True, kept_ns), asked


def test_a_gap_that_stays_is_asked_for_at_each_look_and_not_forever() -> None:
    queue = ReceiveQueue()
    recovery, asked = recovery_of(queue)
    came(queue, 0, 1, 5)
    recovery.check(0)
    assert asked == [], "the subscriber's own recovery comes first"
    recovery.check(LOOK_NS - 1)
    assert asked == []
    recovery.check(LOOK_NS)
    assert asked == [(INPUT, (2, 4))]
    losses = [loss for look in range(2, 20) for loss in recovery.check(look * LOOK_NS)]
    assert asked == [(INPUT, None if n % WHOLE_CACHE == 0 else (2, 4)) for n in range(1, MAX_TRIES + 2)]
    assert losses == [Loss(INPUT, BOOT, 2, 4, False)], "given up once"


def test_a_gap_that_closes_is_asked_for_no_more() -> None:
    queue = ReceiveQueue()
    asked: Asked = []

    def ask(address: str, span: tuple[int, int] | None) -> None:
        asked.append((address, span))
        came(queue, *range(6))

    recovery = GapRecovery(queue, ask, lambda _: True)
    came(queue, 0, 1, 5)
    losses = [loss for second in range(5) for loss in recovery.check(second * SECOND_NS)]
    assert (asked, losses, queue.copies) == ([(INPUT, (2, 4))], [], 3)


def test_while_messages_come_the_rest_is_waited_for() -> None:
    queue = ReceiveQueue()
    recovery, asked = recovery_of(queue)
    came(queue, 0, 1, 5)
    recovery.check(0)
    came(queue, 3)
    recovery.check(SECOND_NS)
    assert asked == []
    recovery.check(2 * SECOND_NS)
    assert asked == [(INPUT, (2, 2)), (INPUT, (4, 4))]


def test_many_holes_are_asked_for_with_few_questions_that_cover_all_of_them() -> None:
    queue = ReceiveQueue()
    recovery, asked = recovery_of(queue)
    came(queue, *(seq for seq in range(1000) if seq % 3 or seq in (0, 999)))
    recovery.check(SECOND_NS)
    spans = [span for _, span in asked if span is not None]
    assert len(spans) == MAX_QUESTIONS
    assert {seq for seq in range(1, 999) if seq % 3 == 0} <= {n for a, b in spans for n in range(a, b + 1)}


def test_ranges_that_lie_close_together_become_one() -> None:
    assert joined([(10, 12), (1, 2), (14, 14), (100, 200), (4, 4)], 3) == [(1, 4), (10, 14), (100, 200)]
    assert joined([(1, 2)], 8) == [(1, 2)]


def test_what_publishers_keep_no_more_is_given_up() -> None:
    queue = ReceiveQueue()
    recovery, asked = recovery_of(queue, kept_ns=2 * SECOND_NS)
    came(queue, 0, 5)
    losses = [(second, loss) for second in range(9) for loss in recovery.check(second * SECOND_NS)]
    assert losses == [(4, Loss(INPUT, BOOT, 1, 4, False))]
    assert len(asked) == 3


def test_a_process_that_stood_still_asks_for_what_it_missed_before() -> None:
    queue = ReceiveQueue()
    recovery, asked = recovery_of(queue, kept_ns=2 * SECOND_NS)
    came(queue, 0, 5)
    queue.excuse_gaps(60 * SECOND_NS)
    assert recovery.check(60 * SECOND_NS) == recovery.check(61 * SECOND_NS) == []
    assert asked == [(INPUT, (1, 4))]


def test_nobody_is_asked_for_live_data_which_are_given_up_at_once() -> None:
    queue = ReceiveQueue()
    recovery = GapRecovery(queue, lambda *_: pytest.fail("asked"), lambda _: False)
    came(queue, 0, 5)
    assert recovery.check(LOOK_NS) == [Loss(INPUT, BOOT, 1, 4, False)]


def test_a_queue_without_room_asks_for_nothing_until_it_has_some() -> None:
    queue = ReceiveQueue(most=10)
    recovery, asked = recovery_of(queue)
    came(queue, *range(20))
    recovery.check(SECOND_NS)
    assert asked == []
    while queue.next(0) is not None:
        pass
    recovery.check(2 * SECOND_NS)
    assert asked == [(INPUT, (0, 9))]


def test_what_a_second_process_sent_and_was_refused_is_asked_for_again() -> None:
    queue = ReceiveQueue()
    recovery, asked = recovery_of(queue)
    came(queue, *range(10))
    queue.want(INPUT, BOOT, [4, 5, 6], 0)
    recovery.check(SECOND_NS)
    assert asked == [(INPUT, (4, 6))]
    came(queue, 5)
    assert queue.copies == 0


def test_a_thread_asks_and_gives_up_however_long_the_peer_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lsu_mesh_services.network.gap_recovery.PAUSE_S", 0.001)
    queue = ReceiveQueue()
    recovery, asked = recovery_of(queue)
    came(queue, 0, 5)
    times = itertools.count(0, LOOK_NS)
    thread = RecoveryThread(recovery, queue, times.__next__)
    end = time.monotonic() + 10.0
    losses: list[Loss] = []
    while not losses and time.monotonic() < end:
        time.sleep(0.005)
        losses = queue.take_losses()
    thread.close()
    assert losses == [Loss(INPUT, BOOT, 1, 4, False)]
    assert len(asked) == MAX_TRIES + 1


@pytest.mark.live
def test_a_publishers_cache_is_asked_over_a_real_link_and_gives_all_that_it_holds(configuration: Configuration) -> None:
    from lsu_mesh_services.bus import Bus, Clock, SessionSettings
    from ports import free_port

    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with (
        Bus(SessionSettings(listen=(endpoint,), cache=8), Clock()) as plant,
        Bus(SessionSettings(connect=(endpoint,), cache=8), Clock()) as asking,
    ):
        for seq in range(20):
            plant.publish(INPUT, payload(configuration, seq), encoding("input"))
        came: list[bytes] = []
        for _ in range(60):  # the first questions may find no link yet
            asking.ask_cache(INPUT)
            while len(came) < 8 and (arrival := asking.next(0.5)) is not None:
                assert arrival.key == INPUT
                came.append(arrival.payload)
            if came:
                break
        assert came == [payload(configuration, seq) for seq in range(12, 20)]


@pytest.mark.live
def test_a_range_of_a_publishers_cache_comes_over_a_real_link_and_copies_do_not(configuration: Configuration) -> None:
    from lsu_mesh_services.bus import Bus, Clock, SessionSettings
    from ports import free_port

    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with (
        Bus(SessionSettings(listen=(endpoint,), cache=400), Clock()) as plant,
        Bus(SessionSettings(connect=(endpoint,), cache=400), Clock()) as asking,
    ):
        asking.watch_numbers()
        asking.subscribe(INPUT)
        plant.announce(INPUT)
        end = time.monotonic() + 30.0
        while plant.links() == 0 and time.monotonic() < end:
            time.sleep(0.05)
        for seq in range(100, 400):
            plant.publish(INPUT, payload(configuration, seq), encoding("input"))
        came: list[Arrival] = []
        while len(came) < 300 and time.monotonic() < end and (arrival := asking.next(5.0)) is not None:
            came.append(arrival)
        assert len(came) == 300
        asking.arrivals.want(INPUT, BOOT, range(250, 300), 0)
        asking.ask_cache(INPUT, (240, 299))
        again = []
        while len(again) < 50 and (arrival := asking.next(5.0)) is not None:
            again.append(arrival.payload)
        assert again == [payload(configuration, seq) for seq in range(250, 300)]
        assert asking.next(0.5) is None
        assert asking.copies == 10
