"""Real faults: what is done to a peer, and how long the mesh takes to see it and to be whole again."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import psutil
from live_mesh import ROOT, SLACK_S, LiveMesh

from lsu_mesh.mesh.keys import PREFIX

ROLES = {"plant": "plant", "sensor": "s2", "filter": "cz", "fusion": "main", "recorder": "recorder"}
"""One peer of each role of the demo."""
BOTH = (signal.SIGTERM, signal.SIGINT)
PARTNERS = {"plant": "s2", "sensor": "cz", "filter": "main", "fusion": "recorder", "recorder": "plant"}
"""The other end of the link that is reset, by role."""
ALL = "all at once"
LEASE_S = 2.0
SETTLE_S = 15.0
"""Recovery of missed messages may take so long on a loaded machine."""


@dataclass(frozen=True)
class Outcome:
    """One fault at one peer. Times in seconds; None: nothing to detect."""

    fault: str
    role: str
    detected: float | None
    by: str
    back: float
    """From the repair (the start of the process, SIGCONT, the healed link) until the peer is on the mesh."""
    resumed: float
    """From then until every estimator has published an estimate of the present."""
    recovered: float
    """From then until every estimator has published one of the present from all of its sources."""
    lost: int
    estimates: int
    inside: int

    @property
    def row(self) -> str:
        """Of the table in Markdown."""
        seen = "nothing to detect" if self.detected is None else f"{self.detected:.2f} s ({self.by})"
        share = "100 %" if self.inside == self.estimates else f"{self.inside / self.estimates:.4%}"
        times = [f"{time:.2f} s" for time in (self.back, self.resumed, self.recovered)]
        cells = (self.fault, self.role, seen, *times, str(self.lost))
        return f"| {' | '.join(cells)} | {share} of {self.estimates} |"


HEADER = """\
| fault | role | detected in | back on the mesh in | estimates in | recovered in | lost samples | containment |
|---|---|---|---|---|---|---|---|"""


def kill(mesh: LiveMesh, role: str, down: float = 1.0) -> Outcome:
    """kill -9, and start again."""
    name = ROLES[role]

    def break_it() -> None:
        mesh.process(name).kill()

    def repair() -> None:
        mesh.until(lambda: name not in mesh.observer.alive, f"{name} is gone")
        while mesh.child(name).restart_at is None:  # it sees the end of the process first
            mesh.supervisor.watch(time.monotonic())
        mesh.supervisor.watch(time.monotonic())

    return suffer(mesh, "kill -9", role, break_it, repair, down, restarts=True)


def restart(mesh: LiveMesh, role: str) -> Outcome:
    """SIGTERM, and start again when it has ended."""
    name = ROLES[role]
    child = mesh.child(name)
    old = child.process

    def break_it() -> None:
        mesh.process(name).terminate()

    def repair() -> None:
        assert old is not None
        assert old.wait(timeout=30) == 0, mesh.words()
        mesh.until(lambda: name not in mesh.observer.alive, f"{name} is gone")
        mesh.supervisor.watch(time.monotonic())
        mesh.supervisor.watch(time.monotonic())

    return suffer(mesh, "restart", role, break_it, repair, 0.0, restarts=True)


def freeze(mesh: LiveMesh, role: str, seconds: float = 4.0) -> Outcome:
    """SIGSTOP, and SIGCONT later."""
    process = mesh.process(ROLES[role])
    return suffer(
        mesh, f"SIGSTOP {seconds:g} s", role, lambda: process.send_signal(signal.SIGSTOP),
        lambda: process.send_signal(signal.SIGCONT), seconds,
    )  # fmt: skip


def stand_still(mesh: LiveMesh, seconds: float = 10.0) -> Outcome:
    """All peers are frozen, as when a virtual machine pauses: longer than publishers keep what they sent."""
    processes = [mesh.process(name) for _, name in mesh.peers]

    def suspend() -> None:
        for process in processes:
            process.suspend()

    def resume() -> None:
        for process in processes:
            process.resume()

    return suffer(mesh, f"SIGSTOP {seconds:g} s", ALL, suspend, resume, seconds, name="plant")


def reset_link(mesh: LiveMesh, role: str) -> Outcome:
    """The connection between two peers is closed by the system; gossip alone would never bring it back.

    Needs ``ss`` of iproute2 and the right to close other processes' sockets.
    """
    ends = mesh.process(ROLES[role]), mesh.process(PARTNERS[role])

    def break_it() -> None:
        for own, other in connections(*ends):
            between = ["sport", "=", f":{own}", "dport", "=", f":{other}"]
            subprocess.run(["ss", "--kill", "--tcp", *between], check=True, stdout=subprocess.DEVNULL)
        assert not connections(*ends), "the system does not close the connection"

    def repair() -> None:
        """Nobody does: the peers have to."""
        mesh.until(lambda: bool(connections(*ends)), f"{ROLES[role]} and {PARTNERS[role]} are linked again")

    return suffer(mesh, f"link to {PARTNERS[role]} is reset", role, break_it, repair, 0.0, heals=True)


def connections(one: psutil.Process, other: psutil.Process) -> set[tuple[int, int]]:
    """Ports of the connections between two processes, those of the first one first."""
    of_one, of_other = (
        {(c.laddr.port, c.raddr.port) for c in process.net_connections("tcp") if c.status == "ESTABLISHED"}
        for process in (one, other)
    )
    return {(own, far) for own, far in of_one if (far, own) in of_other}


def stall(mesh: LiveMesh, role: str, seconds: float = 4.0) -> Outcome:
    """The link carries nothing, without a word to either end."""
    proxy = mesh.proxies[ROLES[role]]
    return suffer(mesh, f"link stalls {seconds:g} s", role, proxy.stall, proxy.heal, seconds)


def cut(mesh: LiveMesh, role: str, seconds: float = 4.0) -> Outcome:
    """The link is closed and stays so."""
    proxy = mesh.proxies[ROLES[role]]
    return suffer(mesh, f"link is cut {seconds:g} s", role, proxy.cut, proxy.heal, seconds)


def delay(mesh: LiveMesh, role: str, seconds: float = 0.2, length: float = 3.0) -> Outcome:
    """Everything from and to the peer is late."""
    proxy = mesh.proxies[ROLES[role]]
    fault = f"link {1000 * seconds:g} ms slower"
    return suffer(mesh, fault, role, lambda: proxy.delay(seconds), proxy.heal, length, tells=False)


def corrupt(mesh: LiveMesh, role: str) -> Outcome:
    """A bit flips on the way; TLS notices and the link begins anew."""
    proxy = mesh.proxies[ROLES[role]]
    before = proxy.flipped

    def repair() -> None:
        mesh.until(lambda: proxy.flipped > before, "a bit flipped")
        proxy.heal()

    return suffer(mesh, "a bit flips (TLS)", role, lambda: proxy.corrupt(1), repair, 0.0)


def suffer(
    mesh: LiveMesh,
    fault: str,
    role: str,
    break_it: Callable[[], None],
    repair: Callable[[], None],
    seconds: float,
    *,
    restarts: bool = False,
    tells: bool = True,
    heals: bool = False,
    name: str | None = None,
) -> Outcome:
    """Break, watch, repair, and wait until all is well.

    ``restarts``: times after the return count from then. ``tells``: the peer is seen to return. ``heals``: the mesh
    repairs itself, and it is back when ``repair`` returns. ``name``: who is watched for the role.
    """
    name = name or ROLES[role]
    begin = mesh.clock.now()
    mesh.until(lambda: mesh.is_current(begin), "all is well before the fault")
    broken = mesh.clock.now()
    break_it()
    time.sleep(seconds)  # how long the fault lasts
    repaired = mesh.clock.now()
    repair()
    back = _await_return(mesh, name, broken, repaired) if tells else repaired
    back = mesh.clock.now() if heals else back
    since = back if restarts else repaired
    mesh.until(lambda: mesh.is_current(since) and mesh.speaks(role, name, since), f"recovered from {fault} of {role}")
    recovered = mesh.clock.now()
    resumed = max(_first_current(mesh, estimator, since) for estimator in mesh.estimators())
    lost = _lost(mesh, recovered)
    inside, count = mesh.containment(broken)
    detected, by = _detected(mesh, role, name, broken)
    return Outcome(
        fault, role, detected, by, (back - repaired) * 1e-9, (resumed - since) * 1e-9, (recovered - since) * 1e-9,
        lost, count, inside,
    )  # fmt: skip


def _first_current(mesh: LiveMesh, estimator: str, since: int) -> int:
    """When the first sound estimate of the present came after a moment."""
    return next(
        seen.arrival_ns
        for seen in mesh.observer.estimates[estimator]
        if seen.arrival_ns > since
        and seen.message.status != "inconsistent"
        and seen.message.step >= mesh.due(seen.arrival_ns) - mesh.steps(SLACK_S)
    )


def _await_return(mesh: LiveMesh, name: str, broken: int, repaired: int) -> int:
    """When the peer was seen again; for one that was never seen gone that is the repair."""

    def returned() -> int | None:
        tokens = [(at, there) for at, who, there in mesh.observer.tokens if who == name and at > broken]
        if not tokens:
            return None
        return tokens[-1][0] if tokens[-1][1] else None

    mesh.until(lambda: name in mesh.observer.alive, f"{name} is back")
    seen = returned()
    return repaired if seen is None else max(seen, repaired)


def _detected(mesh: LiveMesh, role: str, name: str, broken: int) -> tuple[float | None, str]:
    """The first sign: the peer's token is gone, or an estimate lacks what the peer should have sent."""
    gone = [at for at, who, there in mesh.observer.tokens if who == name and not there and at > broken]
    signs = [(gone[0], "token")] if gone else []
    for estimator in mesh.estimators():
        if role in ("sensor", "filter", "fusion") and estimator != name:
            lacking = (s.arrival_ns for s in mesh.observer.estimates[estimator]
                       if s.arrival_ns > broken and name in s.message.missing)  # fmt: skip
            at = next(lacking, None)
            signs += [] if at is None else [(at, "estimates name it missing")]
    if not signs:
        return None, ""
    at, by = min(signs)
    return (at - broken) * 1e-9, by


def _lost(mesh: LiveMesh, since: int) -> int:
    """Messages that have not come to someone although there was time to recover them."""

    def whole() -> bool:
        fresh = all(mesh.observer.health[name][-1][0] > since for _, name in mesh.peers)
        return fresh and sum(mesh.gaps().values()) == 0

    try:
        mesh.until(whole, "nothing is missing", SETTLE_S)
    except AssertionError:
        return int(sum(mesh.gaps().values()))
    return 0


def slow_subscriber(mesh: LiveMesh, seconds: float = 10.0) -> Outcome:
    """A subscriber of everything that is frozen while its queues fill; the others must not feel it."""
    program = (
        "import sys, time\nfrom lsu_mesh_services.bus import Bus, Clock, SessionSettings\n"
        "bus = Bus(SessionSettings(connect=(sys.argv[1],)), Clock())\n"
        f"bus.subscribe('{PREFIX}/*/*/*')\nbus.next(60)\nprint('hears', flush=True)\ntime.sleep(600)\n"
    )
    command = [sys.executable, "-c", program, mesh.configuration.network.entry]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'services'}"},
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "hears\n"
        began = mesh.clock.now()
        process.send_signal(signal.SIGSTOP)
        longest = 0.0
        while (now := mesh.clock.now()) - began < seconds * 1e9:  # nobody waits for it: estimates go on all the time
            longest = max(longest, mesh.until(partial(mesh.is_current, now), "estimates go on"))
        since = mesh.clock.now()
        process.send_signal(signal.SIGCONT)
        lost = _lost(mesh, since)
        inside, count = mesh.containment(began)
        return Outcome(f"SIGSTOP {seconds:g} s", "subscriber", None, "", 0.0, longest, longest, lost, count, inside)
    finally:
        process.kill()
        process.wait()
        process.stdout.close() if process.stdout is not None else None


@dataclass(frozen=True)
class Ending:
    """How one peer stopped."""

    role: str
    name: str
    signal: str
    code: int | None
    """None: it had to be killed."""
    seconds: float


def stop_all(mesh: LiveMesh, patience: float, numbers: Sequence[signal.Signals] = BOTH) -> list[Ending]:
    """All are asked at once, each by the next of these signals."""
    asked = time.monotonic()
    children = [mesh.child(name) for _, name in mesh.peers]
    sent = [numbers[i % len(numbers)] for i in range(len(children))]
    for child, number in zip(children, sent, strict=True):
        mesh.process(child.name).send_signal(number)
    endings = []
    left = dict(enumerate(children))
    while left and time.monotonic() - asked < patience:
        for i, child in list(left.items()):
            if child.process is not None and (code := child.process.poll()) is not None:
                del left[i]
                endings.append(Ending(child.role, child.name, sent[i].name, code, time.monotonic() - asked))
        time.sleep(0.005)
    return endings + [Ending(c.role, c.name, sent[i].name, None, patience) for i, c in left.items()]


def router_outage(mesh: LiveMesh, number: signal.Signals) -> tuple[Outcome, Ending]:
    """The router that all peers are clients of ends, and starts again; how it ended too."""
    begin = mesh.clock.now()
    mesh.until(lambda: mesh.is_current(begin), "all is well before the fault")
    broken = mesh.clock.now()
    process = mesh.child("router").process
    assert process is not None
    process.send_signal(number)
    ending = Ending("router", "router", number.name, process.wait(timeout=60), (mesh.clock.now() - broken) * 1e-9)
    time.sleep(1.0)  # how long the outage lasts
    mesh.supervisor.watch(time.monotonic())
    repaired = mesh.clock.now()
    mesh.supervisor.watch(time.monotonic())
    names = {name for _, name in mesh.peers}

    def returned() -> int | None:
        return next((at for at, _, there in mesh.observer.tokens if there and at > repaired), None)

    mesh.until(lambda: returned() is not None, "the first peer is back")
    back = returned()
    assert back is not None
    mesh.until(lambda: mesh.is_current(back) and names <= mesh.observer.alive, "recovered from the router's outage")
    recovered = mesh.clock.now()
    resumed = max(_first_current(mesh, estimator, back) for estimator in mesh.estimators())
    lost = _lost(mesh, recovered)
    inside, count = mesh.containment(broken)
    gone = [at for at, _, there in mesh.observer.tokens if not there and at > broken]
    words = "kill -9" if number == signal.SIGKILL else f"{number.name}, started again"
    return Outcome(
        words, "router", (gone[0] - broken) * 1e-9 if gone else None, "token", (back - repaired) * 1e-9,
        (resumed - back) * 1e-9, (recovered - back) * 1e-9, lost, count, inside,
    ), ending  # fmt: skip


def lose_router(mesh: LiveMesh) -> None:
    """kill -9 of the router that all peers are clients of, for good."""
    router = mesh.child("router")
    mesh.process("router").kill()
    assert router.process is not None
    router.process.wait()


def freeze_router(mesh: LiveMesh) -> None:
    """Its links stay open and carry nothing, for good."""
    mesh.process("router").send_signal(signal.SIGSTOP)
