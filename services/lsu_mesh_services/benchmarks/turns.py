"""Relay and mesh in turns, and what the subscriber to the fused sets sees of each."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Mapping
from pathlib import Path

from lsu_mesh.experiments.mesh_speed.mesh_case import MeshCase
from lsu_mesh.experiments.mesh_speed.mesh_report import MeshReport, Turn
from lsu_mesh_services.benchmarks.measured_run import FusedArrival, MeasuredRun
from lsu_mesh_services.benchmarks.sides import RealMesh, Relay, Side

WARM_UP_S = 1.0
"""Steps of the first second are run and not counted: connections and caches settle."""
GRACE_S = 2.0
"""So long after the last step its fused set may still come."""


def measure_case(
    case: MeshCase,
    *,
    turns: int,
    seconds: float,
    tree: Path | None = None,
    tell: Callable[[str], None] = lambda words: None,
) -> MeshReport:
    """Run relay and mesh alternately, ``turns`` times each for ``seconds`` of counted steps.

    Every second turn begins with the mesh, so that a machine that grows slower, or faster, favours neither.
    ``DidNotRun`` when processes do not run.
    """
    sides: tuple[Side, Side] = (Relay(case), RealMesh(case))
    found: dict[int, list[Turn]] = {0: [], 1: []}
    for turn in range(turns):
        for which in (0, 1) if turn % 2 == 0 else (1, 0):
            tell(f"{case.words}: turn {turn + 1} of {turns}, {('relay', 'mesh')[which]}")
            found[which].append(run_turn(sides[which], case.rate, seconds, tree=tree if which else None))
    return MeshReport(case, found[0], found[1])


def run_turn(side: Side, rate: float, seconds: float, *, tree: Path | None = None) -> Turn:
    """Start a side, let it run, and end it."""
    first = 1 + math.ceil(WARM_UP_S * rate)
    last = first + max(1, round(seconds * rate)) - 1
    gc.collect()
    was_enabled = gc.isenabled()
    gc.disable()  # no collection of the subscriber delays what arrives
    try:
        with MeasuredRun(side, tree) as run:
            run.await_ready()
            start_ns = run.begin()
            run.listen(intended_ns(start_ns, rate, first))
            before = run.processor_seconds()
            run.listen(intended_ns(start_ns, rate, last + 1))
            after = run.processor_seconds()
            run.listen(intended_ns(start_ns, rate, last + 1) + int(GRACE_S * 1e9), lambda: last in run.fused)
            end_ns = run.clock.now()
    finally:
        if was_enabled:
            gc.enable()
    used = None if before is None or after is None else after - before
    return counted(run.fused, start_ns, rate, steps=range(first, last + 1), end_ns=end_ns)._replace(processor_s=used)


def intended_ns(start_ns: int, rate: float, step: int) -> int:
    """When a step is due, whether or not the processes are in time."""
    return start_ns + int((step - 1) / rate * 1e9)


def counted(fused: Mapping[int, FusedArrival], start_ns: int, rate: float, *, steps: range, end_ns: int) -> Turn:
    """The latency of every step from its intended time on; of a missing one, until the end."""
    latencies = [
        ((fused[k].arrival_ns if k in fused else end_ns) - intended_ns(start_ns, rate, k)) * 1e-6 for k in steps
    ]
    return Turn(
        latencies_ms=latencies,
        missing=sum(k not in fused for k in steps),
        incomplete=sum(k in fused and not fused[k].is_complete for k in steps),
        processor_s=None,
    )
