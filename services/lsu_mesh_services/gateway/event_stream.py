"""Server-sent events: each client takes what is newer than what it has, at its own pace.

Nothing is queued for a client. One that does not read is not written to, and takes the newest state when it reads
again; so many clients cost little more than their sockets.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Protocol

from starlette.types import Receive, Scope, Send

from lsu_mesh.mesh.json_form import dumps
from lsu_mesh_services.gateway.board import Board
from lsu_mesh_services.gateway.server_sent import server_sent

HEARTBEAT_S = 10.0
"""A comment after so long without anything else, so that both ends notice a connection that is gone."""
RETRY_MS = 1000
"""How soon a browser connects again."""
HEADERS = [
    (b"content-type", b"text/event-stream; charset=utf-8"),
    (b"cache-control", b"no-store"),
    (b"x-accel-buffering", b"no"),
]


class Feed(Protocol):
    """What one client reads."""

    def __call__(self) -> bytes:
        """What is new since the last call, as server-sent events; empty where nothing is."""
        ...


@dataclass
class EstimateFeed:
    """Every estimate, of all estimators or of some, as far as they are kept; from the newest of each on."""

    board: Board
    names: tuple[str, ...] | None = None
    is_whole: bool = False
    """Whether sets and provenance are told too."""
    only_newest: bool = False
    """Whether estimates that came in between are left out."""
    with_kept: bool = False
    """Whether what was kept before comes first."""
    _after: int | None = None

    def __call__(self) -> bytes:
        is_first = self._after is None and not self.with_kept
        only_newest, after = self.only_newest or is_first, self._after or 0
        self._after, parcel = self.board.parcel(after, self.names, only_newest=only_newest, is_whole=self.is_whole)
        return parcel


@dataclass
class EventFeed:
    """Every event, from the one on that the client has seen last, as far as they are kept."""

    board: Board
    last_seen: str = ""
    _after: int | None = None

    def __call__(self) -> bytes:
        if self._after is None:
            self._after = self.board.number_of(self.last_seen) if self.last_seen else 0
        entries = self.board.events(self._after)
        if not entries:
            return b""
        self._after = entries[-1].number
        return b"".join(entry.event for entry in entries)


@dataclass
class HealthFeed:
    """The health of the mesh, when it changes and once a second."""

    board: Board
    now: Callable[[], int]
    _after: int = 0

    def __call__(self) -> bytes:
        if self.board.health_number == self._after:
            return b""
        self._after = self.board.health_number
        return server_sent("health", dumps(self.board.health(self.now())))


@dataclass
class Clients:
    """Streams that are open, and whether they are to end."""

    most: int
    open: int = 0
    is_closing: bool = field(default=False)

    @property
    def is_full(self) -> bool:
        """Whether no more streams are served."""
        return self.open >= self.most


@dataclass(frozen=True)
class EventStream:
    """A response that never ends by itself; an ASGI application."""

    feeds: Collection[Feed]
    clients: Clients
    period_s: float

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.clients.open += 1
        left = asyncio.ensure_future(_left(receive))
        try:
            await send({"type": "http.response.start", "status": 200, "headers": HEADERS})
            await self._write(send, b"retry: %d\n\n" % RETRY_MS)
            await self._follow(send, left)
            await send({"type": "http.response.body", "body": b""})
        except OSError:
            return
        finally:
            left.cancel()
            self.clients.open -= 1

    async def _follow(self, send: Send, left: asyncio.Future[None]) -> None:
        silent_s = 0.0
        while not left.done() and not self.clients.is_closing:
            new = b"".join(feed() for feed in self.feeds)
            if not new and silent_s >= HEARTBEAT_S:
                new = b": here\n\n"
            if new:
                await self._write(send, new)
                silent_s = 0.0
            await asyncio.sleep(_until_next(self.period_s))
            silent_s += self.period_s

    async def _write(self, send: Send, body: bytes) -> None:
        await send({"type": "http.response.body", "body": body, "more_body": True})


def _until_next(period_s: float) -> float:
    """Seconds to the next parcel: all clients are served at the same moments, so that they share what is written."""
    now = asyncio.get_running_loop().time()
    return period_s - now % period_s


async def _left(receive: Receive) -> None:
    """Returns when the client has gone."""
    while (await receive())["type"] != "http.disconnect":
        continue
