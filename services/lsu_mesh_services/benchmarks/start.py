"""One start of the benchmark mesh: until its first fused set, and its memory some seconds later."""

from __future__ import annotations

from pathlib import Path

from lsu_mesh.experiments.mesh_speed.mesh_case import MeshCase
from lsu_mesh.experiments.mesh_speed.start_report import Start
from lsu_mesh_services.benchmarks.measured_run import MeasuredRun
from lsu_mesh_services.benchmarks.process_group import DidNotRun
from lsu_mesh_services.benchmarks.sides import RealMesh

RATE, FILTERS = 50.0, 3
"""The size of the demo."""
FIRST_S = 30.0
"""How long the first fused set may take after step 1 is due."""


def one_start(seconds: float, *, recorder: bool, tree: Path | None = None) -> Start:
    """Start all processes, wait for a fused set, and look at the memory ``seconds`` later; ``DidNotRun``."""
    with MeasuredRun(RealMesh(MeshCase(RATE, FILTERS, recorder)), tree) as run:
        run.await_ready()
        linked_ns = run.clock.now()
        start_ns = run.begin()
        run.listen(start_ns + int(FIRST_S * 1e9), lambda: bool(run.fused))
        used = run.processor_seconds()
        if not run.fused:
            raise DidNotRun(f"no fused set came within {FIRST_S:g} s after step 1 was due")
        first_ns = min(arrival.arrival_ns for arrival in run.fused.values())
        run.listen(first_ns + int(seconds * 1e9))
        memory = run.resident_mib()
        return Start((linked_ns - run.began_ns) * 1e-9, (first_ns - run.began_ns) * 1e-9, used, memory)
