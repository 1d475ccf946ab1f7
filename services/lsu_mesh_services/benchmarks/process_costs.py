"""Processor time of a step against the processes of a mesh, and of the relay beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lsu_mesh.experiments.mesh_speed.mesh_case import MeshCase
from lsu_mesh.experiments.mesh_speed.mesh_report import keeps_up, processor_ms_per_step
from lsu_mesh.experiments.mesh_speed.scale import PROCESSES, RELAY, Cost
from lsu_mesh_services.benchmarks.sides import RealMesh
from lsu_mesh_services.benchmarks.turns import measure_case

RATE = 50.0
UNIT = "processor ms a step of all"


def process_costs(
    filters: Sequence[int], seconds: float, tell: Callable[[str], None] = lambda words: None
) -> list[Cost]:
    """For each number of filters, one turn of relay and mesh; none on a system that tells no processor times.

    ``DidNotRun`` when processes do not run.
    """
    found = []
    for count in filters:
        case = MeshCase(RATE, count)
        report, peers = measure_case(case, turns=1, seconds=seconds, tell=tell), len(RealMesh(case).peers)
        for what, turns in ((PROCESSES, report.mesh), (RELAY, report.relay)):
            cost = processor_ms_per_step(turns)
            steps, missing = (sum(len(turn.latencies_ms) for turn in turns), sum(turn.missing for turn in turns))
            found += [] if cost is None else [Cost(what, peers, cost, UNIT, kept_up=keeps_up(missing, steps))]
    return sorted(found, key=lambda cost: cost.what)
