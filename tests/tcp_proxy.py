"""A TCP proxy of our own in userspace that delays, stalls, cuts and corrupts what goes through it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from types import TracebackType
from typing import Any, Self, TypeAlias

from ports import free_port

Work: TypeAlias = Coroutine[Any, Any, None]
CHUNK = 65536
BACKLOG = 64
"""Chunks under way in one direction; then the sender feels it."""


class Proxy:
    """Forwards a free port of the loopback interface to ``target_port``; a context manager.

    Faults act on both directions. A stalled link carries nothing and closes nothing, like a pulled cable; a cut one
    closes what is open and refuses what comes until it is healed.
    """

    def __init__(self, target_port: int) -> None:
        self.port = free_port()
        self.connections = 0
        """Connections that are open now."""
        self.flipped = 0
        """Bits flipped so far."""
        self._target = target_port
        self._delay = 0.0
        self._flips = 0
        self._is_cut = False
        self._writers: set[asyncio.StreamWriter] = set()
        self._loop = asyncio.new_event_loop()
        self._flows = asyncio.Event()
        self._flows.set()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        self._server = self._do(asyncio.start_server(self._serve, "127.0.0.1", self.port))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._do(self._end())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def delay(self, seconds: float) -> None:
        """Let everything arrive so much later, in order."""
        self._delay = seconds

    def stall(self) -> None:
        """Carry nothing and close nothing."""
        self._loop.call_soon_threadsafe(self._flows.clear)

    def cut(self) -> None:
        """Close all connections and refuse new ones."""
        self._is_cut = True
        self._loop.call_soon_threadsafe(self._close_all)

    def corrupt(self, chunks: int) -> None:
        """Flip one bit in each of the next chunks."""
        self._flips = chunks

    def heal(self) -> None:
        """End every fault."""
        self._delay, self._flips, self._is_cut = 0.0, 0, False
        self._loop.call_soon_threadsafe(self._flows.set)

    def _do(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(timeout=10)

    async def _end(self) -> None:
        """Refuse and close; each connection then ends by itself, so that no accepted socket is forgotten."""
        self._is_cut = True
        self._flows.set()
        await asyncio.sleep(0.01)  # what waits to be accepted is: a closed server would leave it open
        self._server.close()
        while len(asyncio.all_tasks()) > 1:
            self._close_all()
            await asyncio.sleep(0.005)
        for _ in range(3):
            await asyncio.sleep(0)  # aborted transports close in the next turns of the loop

    def _close_all(self) -> None:
        for writer in self._writers:
            writer.transport.abort()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            if not self._is_cut:
                await self._forward(reader, writer)
        except OSError:
            return  # there is no target
        finally:
            writer.transport.abort()

    async def _forward(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, onward = await asyncio.open_connection("127.0.0.1", self._target)
        self._writers |= {writer, onward}
        self.connections += 1
        try:
            await _until_one_ends(*self._direction(reader, onward), *self._direction(there, writer))
        finally:
            self.connections -= 1
            self._writers -= {writer, onward}
            onward.transport.abort()

    def _direction(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> tuple[Work, Work]:
        """What was read waits until it is due and the link flows."""
        under_way: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(BACKLOG)
        return self._receive(reader, under_way), self._send(under_way, writer)

    async def _receive(self, reader: asyncio.StreamReader, under_way: asyncio.Queue[tuple[float, bytes]]) -> None:
        while data := await reader.read(CHUNK):
            await under_way.put((self._loop.time() + self._delay, data))

    async def _send(self, under_way: asyncio.Queue[tuple[float, bytes]], writer: asyncio.StreamWriter) -> None:
        while True:
            due, data = await under_way.get()
            await asyncio.sleep(max(0.0, due - self._loop.time()))
            await self._flows.wait()
            writer.write(self._spoiled(data))
            await writer.drain()

    def _spoiled(self, data: bytes) -> bytes:
        if self._flips == 0:
            return data
        self._flips -= 1
        self.flipped += 1
        middle = len(data) // 2
        return data[:middle] + bytes([data[middle] ^ 0x10]) + data[middle + 1 :]


async def _until_one_ends(*works: Work) -> None:
    """Run all until the first ends, in whatever way: a closed end is what the mesh has to cope with."""
    tasks = [asyncio.ensure_future(work) for work in works]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
