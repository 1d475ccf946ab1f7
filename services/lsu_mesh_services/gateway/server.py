"""Serves the application until the process is asked to stop."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable, Iterator

import uvicorn
from starlette.types import ASGIApp

from lsu_mesh_services.gateway.event_stream import Clients

LOOK_S = 0.1
"""Seconds between looks at whether to stop."""
GRACE_S = 1
"""How long open requests may take to end."""


class _Server(uvicorn.Server):
    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """The command handles signals itself."""
        yield


def serve(app: ASGIApp, listener: socket.socket, clients: Clients, is_over: Callable[[], bool]) -> None:
    """Serve on a bound socket until ``is_over``; open streams end then."""
    configuration = uvicorn.Config(
        app, log_level="warning", access_log=False, lifespan="off", ws="none", server_header=False,
        timeout_graceful_shutdown=GRACE_S, timeout_keep_alive=30,
    )  # fmt: skip
    server = _Server(configuration)
    asyncio.run(_run(server, listener, clients, is_over))


async def _run(server: _Server, listener: socket.socket, clients: Clients, is_over: Callable[[], bool]) -> None:
    serving = asyncio.ensure_future(server.serve([listener]))
    while not serving.done() and not is_over():
        await asyncio.sleep(LOOK_S)
    clients.is_closing = True
    server.should_exit = True
    await serving
