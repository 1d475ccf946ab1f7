"""A mesh that runs for long, also with more to do than the machine can: memory, losses, counters, containment.

What was sent is known from sequence numbers, read by an observer beside the mesh. At the end each peer must have
received or given up exactly that, and have said so; what it gave up must have waited for longer than messages may.
"""

from __future__ import annotations

import math
import os
import statistics
import struct
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from live_mesh import LiveMesh, Observer, Seen, TrueStates, holds
from lsu_mesh_services.bus import Bus, Clock, SessionSettings

from lsu_mesh.mesh.access import subscriptions
from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.keys import PREFIX, key
from lsu_mesh.mesh.messages import decode
from lsu_mesh.mesh.sequences import read_head

MIB = 2**20
MAX_GROWTH = 0.02
"""Of a peer's memory from the third quarter of a run to the last, or ``MAX_MIB``, whichever is more."""
MAX_MIB = 4.0
DOMAIN = "model.domain={lower=[-100.0,-100.0,-100.0],upper=[100.0,100.0,100.0]}"
"""From which filters start again behind inputs that they have given up; without one they keep all of them."""
MAX_CURRENT_S = 2.0
"""From the end of the load until all have done all that there is."""
MAX_WAIT_S = 60.0
SETTLE_S = 20.0
"""Until what is missing has come or is given up."""
CHECKED = ("sensor", "filter", "fusion")
"""Roles whose counts must be those of the sequence numbers; the recorder hears of health until its end."""
TOPICS = ("posterior", "fused", "health", "event", "input", "truth", "measurement")
MAX_LATENCY_SAMPLES = 200_000
HEAD = struct.Struct("<qHI")
"""Of each estimate in the file: arrival, lengths of key and payload."""


class Counting(Observer):
    """Writes estimates to a file as they come, and checks them when the run is over: the mesh needs the processors."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.truth = TrueStates(self.configuration)
        self.count = self.inside = 0
        self._newest_payload: dict[str, tuple[int, str, bytes]] = {}
        self.latencies_ms: list[float] = []
        self.newest_number: dict[str, int] = {}
        """By key; every key is of one process that counts from 0."""
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the observer lives

    def take(self, what: str, address: str, payload: bytes, arrival_ns: int) -> None:
        _, _, _, topic, name = address.split("/")
        head = read_head(payload) if what == "sample" else None
        if head is not None:
            self.newest_number[address] = max(head.seq, self.newest_number.get(address, 0))
        if topic in ("input", "truth", "measurement"):
            return
        if what != "sample" or topic not in ("posterior", "fused"):
            super().take(what, address, payload, arrival_ns)
            return
        self._newest_payload[name] = arrival_ns, address, payload
        key = address.encode()
        self._file.write(HEAD.pack(arrival_ns, len(key), len(payload)) + key + payload)

    def newest_estimates(self) -> dict[str, tuple[int, int]]:
        """Arrival and step of the latest of each estimator."""
        newest = dict(self._newest_payload)
        return {
            name: (at, decode(address.split("/")[3], payload).step) for name, (at, address, payload) in newest.items()
        }

    def check(self) -> None:
        """Take all that was written."""
        self._file.seek(0)
        while head := self._file.read(HEAD.size):
            arrival_ns, of_key, of_payload = HEAD.unpack(head)
            address = self._file.read(of_key).decode()
            super().take("sample", address, self._file.read(of_payload), arrival_ns)
        self._file.close()

    def record(self, seen: Seen) -> None:
        message = seen.message
        self.count += 1
        self.inside += holds(message, self.truth[message.step])
        is_first = message.topic == "fused" and message.revision == 0
        if is_first and message.used and len(self.latencies_ms) < MAX_LATENCY_SAMPLES:
            self.latencies_ms.append((seen.arrival_ns - message.origin_ns) * 1e-6)
        self.estimates[message.name] = [seen]


@dataclass
class Report:
    """What the run was like."""

    seconds: float
    rate: float
    estimates: int
    inside: int
    lost: dict[str, float]
    """Messages that each peer, or a subscriber, does not have and has not given up as too old: none."""
    given_up: dict[str, float]
    """Messages that waited for too long in the queue of each."""
    untrue: dict[str, str]
    """Whose counts are not those of the sequence numbers, and how."""
    current_s: dict[str, float]
    """From the end of the load until the estimators, or a slow subscriber, had done all that there was."""
    behind: float
    lag: int
    p50_ms: float
    p99_ms: float
    memory: dict[str, list[float]] = field(default_factory=dict)
    """MiB of each peer, once a second."""
    cores: dict[str, float] = field(default_factory=dict)
    """Share of one processor that each peer has used."""
    load: tuple[float, float] = (0.0, 0.0)
    """Of the machine, at the begin and at the end."""

    def growth(self, name: str) -> float:
        """MiB from the third quarter to the last, by their medians."""
        third, last = quarters(self.memory[name])[2:]
        return statistics.median(last) - statistics.median(third)

    def grows(self) -> list[str]:
        """Peers whose memory does not level off."""
        return [
            name
            for name, samples in self.memory.items()
            if self.growth(name) > max(MAX_MIB, MAX_GROWTH * statistics.median(samples))
        ]

    def is_broken(self) -> bool:
        """Whether a promise was broken."""
        is_late = any(seconds > MAX_CURRENT_S for seconds in self.current_s.values())
        is_false = bool(self.untrue) or any(self.lost.values())
        return self.inside < self.estimates or is_false or is_late or bool(self.grows())

    def _words_of_lost(self) -> str:
        losers = [f"{count:g} by {name}" for name, count in self.lost.items() if count]
        words = [f"messages lost: {', '.join(losers)}" if losers else "no message lost that was still kept"]
        late = [f"{count:g} by {name}" for name, count in self.given_up.items() if count]
        words.append(f"given up as too old and named: {', '.join(late)}" if late else "none given up")
        untrue = [f"{name} ({how})" for name, how in self.untrue.items()]
        words.append(f"untrue counters: {', '.join(untrue)}" if untrue else "all counters true")
        words.append(", ".join(f"{name} current {s:.1f} s after the load" for name, s in self.current_s.items()))
        return ", ".join(words)

    def table(self) -> str:
        """In Markdown."""
        told = (
            f"{self.seconds / 60:.1f} minutes at {self.rate:g} Hz: {self.inside} of {self.estimates} estimates hold "
            f"the truth, {self._words_of_lost()}, {self.behind:g} steps finished without publication, "
            f"{self.lag} steps behind at the end; a fused set came {self.p50_ms:.1f} ms after its oldest measurement "
            f"was sent (p99 {self.p99_ms:.1f} ms). Load {self.load[0]:.1f} at the start, {self.load[1]:.1f} at the end."
        )
        lines = [
            told,
            "",
            "| peer | share of a core | memory in the 1st quarter | 2nd | 3rd | 4th | grows by |",
            "|---|---|---|---|---|---|---|",
        ]
        for name, samples in self.memory.items():
            medians = [f"{statistics.median(quarter):.1f} MiB" for quarter in quarters(samples)]
            cells = (name, f"{self.cores[name]:.0%}", *medians, f"{self.growth(name):+.1f} MiB")
            lines.append(f"| {' | '.join(cells)} |")
        return "\n".join(lines)


def quarters(samples: Sequence[float]) -> list[Sequence[float]]:
    """Four parts of one length."""
    size = max(1, len(samples) // 4)
    return [samples[i * size : (i + 1) * size] for i in range(4)]


def soak(folder: Path, overrides: Sequence[str], seconds: float, *, slow: bool = False) -> Report:
    """Run the demo and watch it; ``slow``: a subscriber reads the estimates at a tenth of their rate."""
    with LiveMesh(folder, [DOMAIN, *overrides], topics=TOPICS, observer=Counting) as mesh:
        observer = mesh.observer
        assert isinstance(observer, Counting)
        mesh.until(lambda: len(observer.newest_estimates()) == len(mesh.estimators()), "estimates flow")
        reader = SlowReader(mesh) if slow else None
        processes = {name: mesh.process(name) for _, name in mesh.peers}
        memory: dict[str, list[float]] = {name: [] for name in processes}
        began, load, used = time.monotonic(), os.getloadavg()[0], _processor_seconds(processes)
        while time.monotonic() - began < seconds:
            for name, process in processes.items():
                memory[name].append(process.memory_info().rss / MIB)
            time.sleep(min(1.0, seconds / 40))
        took, now_used = time.monotonic() - began, _processor_seconds(processes)
        cores = {name: (now_used[name] - used[name]) / took for name in processes}
        lag = max(mesh.due(arrival_ns) - step for arrival_ns, step in observer.newest_estimates().values())
        behind = sum(health[-1][1].counters.get("behind", 0.0) for health in observer.health.values())
        mesh.process("plant").terminate()  # then what is under way comes to an end
        if reader is not None:
            reader.hurry()
        plant = mesh.child("plant").process
        assert plant is not None
        plant.wait()
        current = {"estimators": _until_current(mesh, observer)}
        time.sleep(1.0)
        end = time.monotonic() + SETTLE_S
        while time.monotonic() < end and _untrue(mesh, observer):
            time.sleep(0.5)
        untrue = _untrue(mesh, observer)
        counters = {name: health[-1][1].counters for name, health in observer.health.items()}
        given_up = {name: counts.get("too old", 0.0) for name, counts in counters.items()}
        lost = {name: counts["gaps"] - given_up[name] for name, counts in counters.items()}
        loads = load, os.getloadavg()[0]
        if reader is not None:
            current["slow subscriber"] = reader.current_s
            lost["slow subscriber"], given_up["slow subscriber"] = reader.end(observer.newest_number, untrue)
    observer.check()
    lost["observer"] = float(observer.admission.gaps)
    cuts = statistics.quantiles(observer.latencies_ms, n=100)
    return Report(
        seconds, mesh.configuration.mesh.rate, observer.count, observer.inside, lost, given_up, untrue, current,
        behind, lag, cuts[49], cuts[98], memory, cores, loads,
    )  # fmt: skip


def _until_current(mesh: LiveMesh, observer: Counting) -> float:
    """Seconds until every estimator has published the last step but one, or later."""
    began = time.monotonic()
    last = observer.newest_number[key(mesh.configuration.mesh.name, "truth", "plant")] + 1
    while min(step for _, step in observer.newest_estimates().values()) < last - 1:
        if time.monotonic() - began > MAX_WAIT_S:
            return math.inf
        time.sleep(0.01)
    return time.monotonic() - began


def _untrue(mesh: LiveMesh, observer: Counting) -> dict[str, str]:
    """Peers that have not received or missed, by their own counters, what was sent under the keys they listen to."""
    found = {}
    for role, name in mesh.peers:
        if role in CHECKED:
            keys = [key(mesh.configuration.mesh.name, *one) for one in subscriptions(mesh.configuration, role, name)]
            sent = sum(observer.newest_number.get(address, -1) + 1 for address in keys)
            counts = observer.health[name][-1][1].counters
            refused = sum(count for what, count in counts.items() if what.startswith("refused."))
            known = counts["received"] + counts["gaps"] + refused
            if known != sent:
                found[name] = f"{known:g} of {sent}"
    return found


class SlowReader(threading.Thread):
    """A subscriber of all estimates, with a queue like that of a peer, that reads a tenth of them."""

    def __init__(self, mesh: LiveMesh) -> None:
        super().__init__(daemon=True)
        self._mesh, self._pause = mesh, 10.0 / (len(mesh.estimators()) * mesh.configuration.mesh.rate)
        self._admission = Admission(mesh.configuration, ("posterior", "fused"))
        self._taken: set[tuple[str, int]] = set()
        self._lost: list[tuple[str, int]] = []
        self._is_over = threading.Event()
        self._hurries = 0.0
        self.current_s = math.inf
        self.longest_s, self.too_old = 0.0, 0
        self.start()

    def hurry(self) -> None:
        """The load is over."""
        self._hurries = time.monotonic()

    def run(self) -> None:
        clock, entry = Clock(), self._mesh.configuration.network.entry
        settings = SessionSettings((entry,), (), mode="client", cache=self._mesh.configuration.cached)
        with Bus(settings, clock) as bus:
            kept_ns = self._admission.kept_ns
            assert kept_ns is not None
            bus.bound_age(kept_ns, lambda _: False)
            bus.recover(self._admission.is_cached, kept_ns)
            for topic in ("posterior", "fused"):
                bus.subscribe(f"{PREFIX}/{self._mesh.configuration.mesh.name}/{topic}/*")
            while not self._is_over.is_set():
                for loss in bus.arrivals.take_losses():
                    self._admission.expect(loss.key, loss.boot, loss.first, loss.last)
                    self._lost += [(loss.key, seq) for seq in range(loss.first, loss.last + 1)]
                arrival = bus.next(0.05)
                if arrival is None:
                    if self._hurries and self.current_s == math.inf:
                        self.current_s = max(0.0, time.monotonic() - self._hurries)
                    continue
                self.longest_s = max(self.longest_s, (clock.now() - arrival.arrival_ns) * 1e-9)
                message = self._admission.admit(arrival.key, arrival.payload)
                if message is not None:
                    self._taken.add((arrival.key, message.seq))
                if not self._hurries:
                    time.sleep(self._pause)
            self.too_old = bus.arrivals.too_old

    def end(self, newest: Mapping[str, int], untrue: dict[str, str]) -> tuple[float, float]:
        """What it lost though it was kept, and what it gave up; its counts are compared with the numbers."""
        self._is_over.set()
        self.join(30)
        known = self._taken | set(self._lost)
        first: dict[str, int] = {}
        for address, seq in known:
            first[address] = min(seq, first.get(address, seq))
        missing = {(a, seq) for a, n in first.items() for seq in range(n, newest[a] + 1)} - self._taken
        if sorted(self._lost) != sorted(missing) or self._admission.gaps != len(missing):
            named, gaps = len(self._lost), self._admission.gaps
            untrue["slow subscriber"] = f"{gaps} gaps, {named} named, {len(missing)} missing"
        return float(len(missing) - self.too_old), float(self.too_old)


def _processor_seconds(processes: Mapping[str, psutil.Process]) -> dict[str, float]:
    times = {name: process.cpu_times() for name, process in processes.items()}
    return {name: spent.user + spent.system for name, spent in times.items()}
