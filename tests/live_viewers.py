"""What a viewer does to a real run: latency of the fused stream without one, with one attached, frozen and killed."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from headless_viewer import HeadlessViewer
from live_mesh import LiveMesh
from lsu_mesh_services.recording.read import read_raw
from ports import free_port

from lsu_mesh.mesh.messages import Fused, decode

PHASES = ("no viewer", "attached", "frozen", "killed")


class Phase(NamedTuple):
    """The fused stream during one phase, seen by a subscriber of its own."""

    name: str
    steps: int
    missing: int
    """Steps between the first and the last that did not come."""
    p50_ms: float
    """Age of the oldest measurement at the arrival."""
    p99_ms: float
    longest_pause_ms: float
    """Between one fused set and the next."""


class Outcome(NamedTuple):
    """All phases, and what the recording holds of them."""

    phases: dict[str, Phase]
    messages: int
    """In the recording."""
    gaps: list[str]
    """Where numbers of messages are missing in the recording between the first and the last of a process."""
    recorded_steps: int
    """Fused steps in the recording."""

    def table(self) -> str:
        """As Markdown."""
        lines = ["| viewer | steps | missing | p50 | p99 | longest pause |", "|---|---|---|---|---|---|"]
        for one in self.phases.values():
            numbers = f"{one.p50_ms:.1f} ms | {one.p99_ms:.1f} ms | {one.longest_pause_ms:.0f} ms"
            lines.append(f"| {one.name} | {one.steps} | {one.missing} | {numbers} |")
        return "\n".join([*lines, "", f"recording: {self.messages} messages, {len(self.gaps)} gaps"])


def measure(folder: Path, seconds: float, rate: float) -> Outcome:
    """Run the demo as processes with a recorder that serves viewers, each phase so long."""
    port, phases = free_port(), {}
    with LiveMesh(folder, [f"mesh.rate={rate}"], serve=port) as mesh:
        mesh.until(lambda: mesh.is_current(0), "estimates flow")

        def phase(name: str) -> None:
            since = mesh.clock.now()
            time.sleep(seconds)
            phases[name] = looked_at(name, mesh, since)

        phase("no viewer")
        with HeadlessViewer() as viewer:
            viewer.follow(f"rerun+http://127.0.0.1:{port}/proxy")
            phase("attached")
            _follows(viewer, mesh.until)
            with viewer.frozen():
                phase("frozen")
                viewer.kill()
            phase("killed")
        last = mesh.due()
        mesh.until(lambda: mesh.observer.estimates["main"][-1].message.step >= last, "the fused stream goes on")
        time.sleep(1.0)  # two flushes and more
    messages, gaps, steps = recorded(folder / "run.rrd")
    return Outcome(phases, messages, gaps, steps)


def _follows(viewer: HeadlessViewer, until: Callable[..., float]) -> None:
    """The viewer has what was sent: else the phase says nothing."""
    seen = viewer.last_step()
    until(lambda: viewer.last_step() > seen, "the viewer follows")


def looked_at(name: str, mesh: LiveMesh, since_ns: int) -> Phase:
    """The fused sets that came since a moment."""
    first: dict[int, tuple[int, int]] = {}
    for seen in list(mesh.observer.estimates["main"]):
        if seen.arrival_ns >= since_ns:
            first.setdefault(seen.message.step, (seen.arrival_ns, seen.message.origin_ns))
    arrivals = np.array([arrival for arrival, _ in first.values()])
    ages = np.array([arrival - origin for arrival, origin in first.values()]) * 1e-6
    p50, p99 = np.percentile(ages, [50, 99])
    missing = max(first) - min(first) + 1 - len(first)
    return Phase(name, len(first), missing, float(p50), float(p99), float(np.diff(np.sort(arrivals)).max() * 1e-6))


def recorded(path: Path) -> tuple[int, list[str], int]:
    """Messages, gaps, and fused steps of a recording, also of one whose recorder was killed."""
    numbers: defaultdict[tuple[str, str], set[int]] = defaultdict(set)
    messages, steps = 0, set()
    for key, _, payload in read_raw(path):
        message = decode(key.split("/")[3], payload)
        numbers[key, message.boot].add(message.seq)
        messages += 1
        if isinstance(message, Fused):
            steps.add(message.step)
    gaps = [
        f"{key}: {max(found) - min(found) + 1 - len(found)} of {len(found)} missing"
        for (key, _), found in numbers.items()
        if len(found) != max(found) - min(found) + 1
    ]
    return messages, gaps, len(steps)
