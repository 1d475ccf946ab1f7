"""Gaps that the subscriber's own recovery leaves open are asked for again."""

from __future__ import annotations

from pathlib import Path

import pytest
from lsu_mesh_services.network.gap_recovery import LOOK_NS, MAX_TRIES, SECOND_NS, GapRecovery

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.config.settings import CACHED_SECONDS
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import VERSION, Input, encode, encoding

INPUT = key("demo", "input", "plant")


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


@pytest.fixture
def admission(configuration: Configuration) -> Admission:
    """Has seen 0, 1 and 5."""
    admission = Admission(configuration, ["input"])
    for seq in (0, 1, 5):
        assert admission.admit(INPUT, payload(configuration, seq)) is not None
    return admission


def test_a_gap_that_stays_is_asked_for_at_each_look_and_not_forever(admission: Admission) -> None:
    asked: list[str] = []
    recovery = GapRecovery(admission, asked.append)
    recovery.check(0)
    assert asked == [], "the subscriber's own recovery comes first"
    recovery.check(LOOK_NS - 1)
    assert asked == []
    recovery.check(LOOK_NS)
    assert asked == [INPUT]
    for look in range(2, 20):
        recovery.check(look * LOOK_NS)
    assert asked == [INPUT] * MAX_TRIES


def test_a_gap_that_closes_is_asked_for_no_more(admission: Admission, configuration: Configuration) -> None:
    asked: list[str] = []

    def ask(address: str) -> None:
        asked.append(address)
        for seq in range(6):
            admission.admit(address, payload(configuration, seq))

    recovery = GapRecovery(admission, ask)
    for second in range(5):
        recovery.check(second * SECOND_NS)
    assert asked == [INPUT]
    assert (admission.gaps, admission.gaps_by_key()) == (0, {})


def test_a_peer_that_has_more_than_enough_to_do_asks_less_often_and_while_publishers_remember(
    admission: Admission,
) -> None:
    asked: list[int] = []
    second = 0
    recovery = GapRecovery(admission, lambda _: asked.append(second))
    for second in range(6):
        recovery.check(second * SECOND_NS, waiting=5000)
    assert asked == [2, 4], "it looks at 0, 2 and 4"
    assert asked[0] < CACHED_SECONDS
    for second in (6, 7):
        recovery.check(second * SECOND_NS, waiting=10)
    assert asked == [2, 4, 6, 7]


def test_while_messages_come_the_rest_is_waited_for(admission: Admission, configuration: Configuration) -> None:
    asked: list[str] = []
    recovery = GapRecovery(admission, asked.append)
    recovery.check(0)
    admission.admit(INPUT, payload(configuration, 3))
    recovery.check(SECOND_NS)
    assert asked == []
    recovery.check(2 * SECOND_NS)
    assert asked == [INPUT]


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
