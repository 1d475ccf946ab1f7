"""Streams: what a client gets, how it comes back, and that one which does not read costs nothing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from gateway_mesh import START_NS
from lsu_mesh_services.gateway.board import KEPT_ESTIMATES, Board
from lsu_mesh_services.gateway.event_stream import Clients, EstimateFeed, EventFeed, EventStream, HealthFeed

from lsu_mesh.mesh.messages import Message

Make = Callable[..., Message]


def fill(board: Board, message: Make, steps: range) -> None:
    for step in steps:
        board.record(message("posterior", step=step, seq=step), START_NS)


def told_steps(text: bytes) -> list[int]:
    return [int(part.split(b",")[0]) for part in text.split(b'"step":')[1:]]


def test_a_stream_begins_with_the_newest_and_goes_on_with_every_one(board: Board, message: Make) -> None:
    fill(board, message, range(1, 4))
    feed = EstimateFeed(board)
    assert told_steps(feed()) == [3]
    assert feed() == b""
    fill(board, message, range(4, 7))
    assert told_steps(feed()) == [4, 5, 6]


def test_a_stream_of_the_newest_leaves_out_what_came_between(board: Board, message: Make) -> None:
    feed = EstimateFeed(board, only_newest=True)
    fill(board, message, range(1, 4))
    assert told_steps(feed()) == [3]
    fill(board, message, range(4, 7))
    assert told_steps(feed()) == [6]


def test_the_page_gets_what_was_kept_first(board: Board, message: Make) -> None:
    fill(board, message, range(1, 4))
    assert told_steps(EstimateFeed(board, with_kept=True)()) == [1, 2, 3]


def test_of_a_slow_client_newer_estimates_replace_older_ones(board: Board, message: Make) -> None:
    feed = EstimateFeed(board)
    fill(board, message, range(1, 2))
    feed()
    fill(board, message, range(2, 3 * KEPT_ESTIMATES))
    assert told_steps(feed()) == list(range(2 * KEPT_ESTIMATES, 3 * KEPT_ESTIMATES))


def test_a_client_that_comes_back_gets_the_events_that_it_missed(board: Board, message: Make) -> None:
    for k in range(4):
        board.record(message("event", seq=k), START_NS)
    ids = [line for line in EventFeed(board)().split(b"\n") if line.startswith(b"id: ")]
    assert len(ids) == 4
    again = EventFeed(board, ids[1].removeprefix(b"id: ").decode())()
    assert [line for line in again.split(b"\n") if line.startswith(b"id: ")] == ids[2:]
    assert EventFeed(board, "event:x:y:0")().count(b"id: ") == 4, "not known any more: all that is kept"


def test_health_is_a_line_of_json(board: Board) -> None:
    feed = HealthFeed(board, lambda: START_NS)
    assert feed().startswith(b'event: health\ndata: {"mesh":"lab"')
    assert feed() == b""


class Client:
    """What a server does for a client; ``reads`` of it is cleared while the client reads nothing."""

    def __init__(self) -> None:
        self.sent: list[dict[str, Any]] = []
        self.reads, self.leaves = asyncio.Event(), asyncio.Event()
        self.reads.set()

    async def receive(self) -> dict[str, Any]:
        await self.leaves.wait()
        return {"type": "http.disconnect"}

    async def send(self, message: Any) -> None:
        await self.reads.wait()
        self.sent.append(message)

    @property
    def body(self) -> bytes:
        return b"".join(message.get("body", b"") for message in self.sent)


def test_clients_come_stall_and_go(board: Board, message: Make) -> None:
    async def story() -> None:
        clients, slow, quick = Clients(2), Client(), Client()
        tasks = [
            asyncio.create_task(EventStream([EstimateFeed(board)], clients, 0.005)({}, one.receive, one.send))
            for one in (slow, quick)
        ]
        fill(board, message, range(1, 2))
        await asyncio.sleep(0.05)
        assert clients.is_full
        assert b"retry: 1000\n\nevent: estimate" in quick.body
        slow.reads.clear()
        for step in range(2, 40):
            fill(board, message, range(step, step + 1))
            await asyncio.sleep(0.006)
        assert told_steps(quick.body) == list(range(1, 40)), "the slow one delays nobody"
        assert len(told_steps(slow.body)) <= 2
        slow.reads.set()
        await asyncio.sleep(0.05)
        assert told_steps(slow.body)[-1] == 39
        quick.leaves.set()
        await asyncio.wait_for(tasks[1], 5)
        assert clients.open == 1
        clients.is_closing = True
        await asyncio.wait_for(tasks[0], 5)
        assert slow.sent[-1] == {"type": "http.response.body", "body": b""}
        assert clients.open == 0

    asyncio.run(story())


def test_a_silent_stream_beats(board: Board, monkeypatch: Any) -> None:
    monkeypatch.setattr("lsu_mesh_services.gateway.event_stream.HEARTBEAT_S", 0.01)

    async def story() -> None:
        clients, client = Clients(1), Client()
        task = asyncio.create_task(EventStream([EventFeed(board)], clients, 0.005)({}, client.receive, client.send))
        await asyncio.sleep(0.1)
        client.leaves.set()
        await task
        assert b": here\n\n" in client.body

    asyncio.run(story())
