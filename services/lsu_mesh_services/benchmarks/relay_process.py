"""One process of the relay: it passes steps on, with the session of a real peer and without a peer's work.

A message is the number of its step, 8 bytes, and zeros up to the size that the mesh's message has.
"""

from __future__ import annotations

import sys
import time
from collections import Counter

from lsu_mesh_services.benchmarks.relay_plan import RelayPart
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.stop import Stop

STEP_BYTES = 8
MAX_WAIT = 0.1
"""Seconds between looks at the stop flag, as in a peer."""
LINKS_S = 60.0
"""How long to wait for the links to all others."""
MAX_PENDING = 4096
"""Steps that may be incomplete at once; older ones are forgotten."""
ENCODING = "application/octet-stream"


def step_payload(step: int, size: int) -> bytes:
    """The message of a step."""
    return step.to_bytes(STEP_BYTES, "big").ljust(size, b"\0")


def step_of(payload: bytes) -> int:
    """The step of a message."""
    return int.from_bytes(payload[:STEP_BYTES], "big")


class StepsAwaited:
    """Counts, for each step, the keys at which it has arrived."""

    def __init__(self, awaits: tuple[str, ...]) -> None:
        self._awaits = frozenset(awaits)
        self._counts: Counter[int] = Counter()

    def complete(self, address: str, step: int) -> bool:
        """Note an arrival; True when it is the last of its step."""
        if address not in self._awaits:
            return False
        self._counts[step] += 1
        if self._counts[step] < len(self._awaits):
            if len(self._counts) > MAX_PENDING:
                del self._counts[min(self._counts)]
            return False
        del self._counts[step]
        return True


def run(part: RelayPart, entry: str, stop: Stop) -> None:
    """Until asked to end. The part that keeps the time reads its start from standard input."""
    clock = Clock()
    settings = SessionSettings(connect=(entry,), cache=part.cache)
    with Bus(settings, clock) as bus:
        for address in part.announces:
            bus.announce(address)
        for address in part.reads:
            bus.subscribe(address)
        for address in part.live:
            bus.subscribe_live(address)
        _await_links(bus, part.links, stop)
        bus.declare_alive(part.alive)
        if part.rate:
            line = sys.stdin.readline().strip()
            if line:  # else the measurement has ended before its first step
                _keep_time(part, bus, clock, int(line), stop=stop)
        else:
            _pass_on(part, bus, stop)


def _await_links(bus: Bus, count: int, stop: Stop) -> None:
    end = time.monotonic() + LINKS_S
    while bus.links() < count and not stop and time.monotonic() < end:
        time.sleep(0.02)


def _keep_time(part: RelayPart, bus: Bus, clock: Clock, start_ns: int, *, stop: Stop) -> None:
    step = 1
    while not stop:
        due = start_ns + int((step - 1) / part.rate * 1e9)
        wait = (due - clock.now()) * 1e-9
        if wait > 0:
            bus.next(min(MAX_WAIT, max(0.0005, wait)))
            continue
        _send(part, bus, step)
        step += 1


def _pass_on(part: RelayPart, bus: Bus, stop: Stop) -> None:
    awaited = StepsAwaited(part.awaits)
    while not stop:
        arrival = bus.next(MAX_WAIT)
        if arrival is not None and awaited.complete(arrival.key, step_of(arrival.payload)):
            _send(part, bus, step_of(arrival.payload))


def _send(part: RelayPart, bus: Bus, step: int) -> None:
    for address, size in part.sends.items():
        bus.publish(address, step_payload(step, size), ENCODING)


if __name__ == "__main__":
    from lsu_mesh_services.stop import leave

    run(RelayPart.read(sys.argv[1]), sys.argv[2], Stop())
    leave(0)
