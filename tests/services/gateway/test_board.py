"""What the board keeps, and for how many."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from gateway_mesh import START_NS
from lsu_mesh_services.gateway.board import KEPT_ESTIMATES, KEPT_EVENTS, Board, Connection

from lsu_mesh.mesh.messages import Message

Make = Callable[..., Message]
SECOND = 10**9


def steps(entries: list) -> list[int]:  # type: ignore[type-arg]
    return [entry.message.step for entry in entries]


def test_readers_take_what_is_newer_than_what_they_have(board: Board, message: Make) -> None:
    for step in (1, 2, 3):
        board.record(message("posterior", step=step, seq=step), START_NS)
    first = board.estimates()
    assert steps(first) == [1, 2, 3]
    assert board.estimates(first[-1].number) == []
    board.record(message("posterior", step=4, seq=4), START_NS)
    assert steps(board.estimates(first[-1].number)) == [4]
    assert steps(board.newest()) == [4]
    assert board.newest(board.newest()[0].number) == []


def test_a_corrected_old_step_is_told_and_is_not_the_newest(board: Board, message: Make) -> None:
    board.record(message("posterior", step=9, seq=1), START_NS)
    board.record(message("posterior", step=7, seq=2, revision=1), START_NS)
    assert steps(board.estimates()) == [9, 7]
    assert steps(board.newest()) == [9]
    board.record(message("posterior", step=9, seq=3, revision=1), START_NS)
    assert board.newest()[0].message.revision == 1  # type: ignore[attr-defined]


def test_a_mesh_that_was_started_again_is_newer(board: Board, message: Make) -> None:
    board.record(message("posterior", step=900, sent_ns=START_NS), START_NS)
    board.record(message("posterior", step=1, boot="f" * 16, sent_ns=START_NS + 1), START_NS)
    assert steps(board.newest()) == [1]
    board.record(message("posterior", step=901, sent_ns=START_NS), START_NS)
    assert steps(board.newest()) == [1], "an old process that comes late"


def test_estimators_are_told_apart(board: Board, message: Make) -> None:
    board.record(message("posterior", step=5), START_NS)
    board.record(message("fused", step=5, src="fusion/main"), START_NS)
    assert [entry.message.name for entry in board.newest()] == ["box", "main"]
    assert [entry.message.name for entry in board.estimates(0, ["main"])] == ["main"]


def test_nothing_grows(board: Board, message: Make) -> None:
    for k in range(KEPT_ESTIMATES + 10):
        board.record(message("posterior", step=k + 1, seq=k), START_NS)
    for k in range(KEPT_EVENTS + 10):
        board.record(message("event", seq=k), START_NS)
    assert len(board.estimates()) == KEPT_ESTIMATES
    assert steps(board.estimates())[-1] == KEPT_ESTIMATES + 10
    assert len(board.events()) == KEPT_EVENTS


def test_events_have_names_that_outlive_the_gateway(board: Board, message: Make) -> None:
    for k in range(3):
        board.record(message("event", seq=k), START_NS)
    names = [entry.identity for entry in board.events()]
    assert names[1] == "event:filter/box:0123456789abcdef:1"
    assert [entry.message.seq for entry in board.events(board.number_of(names[1]))] == [2]
    assert board.number_of("event:filter/box:other:1") == 0


def test_levels_say_since_when_they_are(board: Board, message: Make) -> None:
    board.record(message("health"), START_NS + SECOND)
    board.check(START_NS + SECOND)
    board.check(START_NS + 2 * SECOND)
    told = {peer["name"]: peer for peer in board.health(START_NS + 2 * SECOND)["peers"]}
    assert told["box"]["level"] == "OK"
    assert told["box"]["since_ns"] == str(START_NS + SECOND)
    assert told["box"]["since"] == "2026-05-01T12:00:01.000+00:00"
    board.record_presence("box", is_there=False)
    board.check(START_NS + 3 * SECOND)
    told = {peer["name"]: peer for peer in board.health(START_NS + 3 * SECOND)["peers"]}
    assert told["box"]["level"] == "STALE"
    assert told["box"]["reasons"] == ["left the mesh"]
    assert told["box"]["since_ns"] == str(START_NS + 3 * SECOND)


def test_health_is_told_on_change_and_once_a_second(board: Board, message: Make) -> None:
    board.check(START_NS)
    before = board.health_number
    board.check(START_NS + SECOND // 4)
    assert board.health_number == before
    board.record(message("health"), START_NS + SECOND // 4)
    board.check(START_NS + SECOND // 2)
    assert board.health_number > before, "a level has changed"
    before = board.health_number
    board.check(START_NS + SECOND // 2 + SECOND)
    assert board.health_number > before, "a second has passed"
    before = board.health_number
    board.check(START_NS + SECOND // 2 + SECOND, Connection(links=3))
    assert board.health_number > before, "it is connected"


@pytest.mark.parametrize(("links", "trying"), [(0, ["tcp/127.0.0.1:7447"]), (2, [])])
def test_it_is_said_whom_the_gateway_tries_to_reach(board: Board, links: int, trying: list[str]) -> None:
    board.check(START_NS, Connection(links, ("tcp/127.0.0.1:7447",), refused=2, last_refusal="a key"))
    health = board.health(START_NS)
    assert (health["links"], health["trying"], health["refused"]) == (links, trying, 2)
    assert health["last_refusal"] == "a key"
