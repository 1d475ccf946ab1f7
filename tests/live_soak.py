"""A mesh that runs for long: everyone's memory, what was lost, and whether every estimate holds the truth."""

from __future__ import annotations

import os
import statistics
import struct
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from live_mesh import LiveMesh, Observer, Seen, TrueStates, holds

from lsu_mesh.mesh.messages import decode

MIB = 2**20
MAX_GROWTH = 0.02
"""Of a peer's memory from the third quarter of a run to the last, or ``MAX_MIB``, whichever is more."""
MAX_MIB = 4.0
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
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the observer lives

    def take(self, what: str, address: str, payload: bytes, arrival_ns: int) -> None:
        _, _, _, topic, name = address.split("/")
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
    """Messages that each peer, or the observer, knows to exist and does not have, or had no room for."""
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
        return self.inside < self.estimates or any(self.lost.values()) or bool(self.grows())

    def _words_of_lost(self) -> str:
        losers = [f"{count:g} by {name}" for name, count in self.lost.items() if count]
        return f"messages lost: {', '.join(losers)}" if losers else "no message lost"

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


def soak(folder: Path, overrides: Sequence[str], seconds: float) -> Report:
    """Run the demo and watch it."""
    topics = ("posterior", "fused", "health", "event")
    with LiveMesh(folder, overrides, topics=topics, observer=Counting) as mesh:
        observer = mesh.observer
        assert isinstance(observer, Counting)
        mesh.until(lambda: len(observer.newest_estimates()) == len(mesh.estimators()), "estimates flow")
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
        plant = mesh.child("plant").process
        assert plant is not None
        plant.wait()
        since = mesh.clock.now()
        mesh.until(
            lambda: all(h[-1][0] > since for n, h in observer.health.items() if n != "plant"), "a last word", 120
        )
        lost, loads = mesh.gaps(), (load, os.getloadavg()[0])
    observer.check()
    lost["observer"] = float(observer.admission.gaps)
    cuts = statistics.quantiles(observer.latencies_ms, n=100)
    return Report(
        seconds, mesh.configuration.mesh.rate, observer.count, observer.inside, lost, behind, lag, cuts[49], cuts[98],
        memory, cores, loads,
    )  # fmt: skip


def _processor_seconds(processes: Mapping[str, psutil.Process]) -> dict[str, float]:
    times = {name: process.cpu_times() for name, process in processes.items()}
    return {name: spent.user + spent.system for name, spent in times.items()}
