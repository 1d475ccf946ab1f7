"""What comes keeps a run from nothing."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lsu_mesh_services.bus import Clock
from lsu_mesh_services.mesh_launcher import MAX_AT_ONCE, Run
from lsu_mesh_services.monitoring.run_report import RunReport
from lsu_mesh_services.network.receive_queue import Arrival
from lsu_mesh_services.supervisor import Supervisor

from lsu_mesh.mesh.config import load


class Flood:
    """A bus whose queue is never empty."""

    def __init__(self) -> None:
        self.taken = 0

    def next(self, timeout: float) -> Arrival:
        self.taken += 1
        return Arrival("alive", "lsu/v1/demo/live/cz", b"", 1)


def test_a_flood_does_not_keep_a_run_from_looking_at_its_children_and_at_who_says_stop(demo: Path) -> None:
    configuration = load(demo)
    flood: Any = Flood()
    supervisor = Supervisor(configuration.supervisor)
    looked = []
    supervisor.watch = lambda now: looked.append(now) or []  # type: ignore[method-assign, func-returns-value]
    stop: Any = False
    run = Run(configuration, argparse.Namespace(), supervisor, flood, Clock(), stop, RunReport(configuration), None)
    run.turn()
    assert len(looked) == 1
    assert flood.taken == MAX_AT_ONCE
    assert run.alive == {"cz"}
