"""One run of a side: its processes, a subscriber to its fused sets, and their processor time and memory."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import msgspec

from lsu_mesh.mesh.keys import parse
from lsu_mesh_services.benchmarks.process_group import DidNotRun, ProcessGroup
from lsu_mesh_services.benchmarks.process_usage import processor_seconds, resident_mib
from lsu_mesh_services.benchmarks.sides import FUSED, HEALTH, LIVE, FusedStep, Side
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.network.receive_queue import Arrival, ReceiveQueue
from lsu_mesh_services.viewers import free_port

READY_S = 300.0
"""How long all processes may take to be there, on a machine that is busy; the kernels are compiled before."""
LINKS_S = 30.0
"""How long to wait for the last links between them when all are there."""
LEAD_S = 0.3
"""So long after it is told lies the time of step 1."""
MAX_BYTES = 2**30
"""The subscriber never drops: so much may wait in its queue."""


class FusedArrival(NamedTuple):
    """When the first fused set of a step came."""

    arrival_ns: int
    is_complete: bool


class _Health(msgspec.Struct):
    counters: dict[str, float] = {}


class MeasuredRun:
    """Starts a side when it is entered, and ends it whatever happens.

    Parameters
    ----------
    side:
        What runs.
    tree:
        Checkout whose programs run; ``None``: this one.

    Raises
    ------
    DidNotRun
        When a process ends too early, or is not there in time.
    """

    def __init__(self, side: Side, tree: Path | None = None) -> None:
        self._side, self._tree = side, tree
        self.clock = Clock()
        self.began_ns = 0
        """When the first process was started."""
        self.fused: dict[int, FusedArrival] = {}
        """By step."""
        self._alive: set[str] = set()
        self._links: dict[str, float] = {}
        self._health = msgspec.msgpack.Decoder(_Health)
        self._resources = ExitStack()

    def __enter__(self) -> Self:
        try:
            self._start()
        except BaseException:
            self._resources.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._resources.close()

    def _start(self) -> None:
        folder = Path(self._resources.enter_context(tempfile.TemporaryDirectory()))
        entry = f"tcp/127.0.0.1:{free_port()}"
        queue = ReceiveQueue(MAX_BYTES, MAX_BYTES)
        self._bus = self._resources.enter_context(Bus(SessionSettings(listen=(entry,)), self.clock, queue))
        self._bus.subscribe_live(FUSED)
        if self._side.tells_links:
            self._bus.subscribe_live(HEALTH)
        self._bus.watch_tokens(LIVE, "alive", "gone")
        self._group = self._resources.enter_context(ProcessGroup(self._tree))
        self.began_ns = self.clock.now()
        self._side.start(self._group, entry, folder)

    def await_ready(self) -> None:
        """Wait until all processes are there and linked to one another."""
        self._wait(lambda: self._alive >= self._side.names, READY_S, "start")
        if self._side.tells_links:
            count = len(self._side.names)
            is_linked = lambda: all(self._links.get(name, 0.0) >= count for name in self._side.names)  # noqa: E731
            self._wait(is_linked, LINKS_S, "find one another")

    def _wait(self, met: Callable[[], bool], seconds: float, what: str) -> None:
        end = time.monotonic() + seconds
        while not met():
            self._group.check()
            if time.monotonic() > end:
                absent = ", ".join(sorted(self._side.names - self._alive)) or "none"
                raise DidNotRun(
                    f"the processes did not {what} within {seconds:g} s; not there: {absent}\n{self._group.words()}"
                )
            self._take(0.02)

    def begin(self) -> int:
        """Tell the time of step 1, and return it in nanoseconds."""
        start_ns = self.clock.now() + int(LEAD_S * 1e9)
        self._group.tell(self._side.clock, str(start_ns))
        return start_ns

    def listen(self, until_ns: int, is_over: Callable[[], bool] = lambda: False) -> None:
        """Take what arrives until a moment, or until ``is_over``."""
        while not is_over() and (left := (until_ns - self.clock.now()) * 1e-9) > 0:
            self._take(min(0.05, left))
        self._group.check()

    def processor_seconds(self) -> float | None:
        """Processor time of all processes so far."""
        return processor_seconds(self._group.pids.values())

    def resident_mib(self) -> dict[str, float | None]:
        """Resident memory of each process by ``role name``."""
        return {label: resident_mib(pid) for label, pid in self._group.pids.items()}

    def _take(self, timeout: float) -> None:
        arrival = self._bus.next(timeout)
        while arrival is not None:
            self._record(arrival)
            arrival = self._bus.next(0)

    def _record(self, arrival: Arrival) -> None:
        if arrival.what == "sample" and arrival.key == FUSED:
            found: FusedStep = self._side.read(arrival.payload)
            self.fused.setdefault(found.step, FusedArrival(arrival.arrival_ns, found.is_complete))
            return
        address = parse(arrival.key)
        if address is None:
            return
        if arrival.what == "sample":
            self._links[address.name] = self._health.decode(arrival.payload).counters.get("links", 0.0)
        elif arrival.what == "alive":
            self._alive.add(address.name)
        else:
            self._alive.discard(address.name)
