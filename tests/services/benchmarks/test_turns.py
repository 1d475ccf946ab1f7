"""Latencies count from the intended time of a step, so that a stall is seen in every step that it delays."""

from __future__ import annotations

import pytest
from lsu_mesh_services.benchmarks.measured_run import FusedArrival
from lsu_mesh_services.benchmarks.turns import counted, intended_ns

MS = 1_000_000


def test_a_stall_counts_in_every_step_that_it_delays() -> None:
    """Steps 2 and 3 come together at 25 ms: were they counted from when they are sent, one of them would be quick."""
    fused = {k: FusedArrival(at * MS, True) for k, at in ((1, 2), (2, 25), (3, 25))}
    turn = counted(fused, 0, 100.0, steps=range(1, 4), end_ns=99 * MS)
    assert turn.latencies_ms == pytest.approx([2.0, 15.0, 5.0])
    assert (turn.missing, turn.incomplete) == (0, 0)


def test_a_step_without_a_set_counts_until_the_end() -> None:
    fused = {2: FusedArrival(12 * MS, False), 9: FusedArrival(90 * MS, False)}
    turn = counted(fused, 0, 100.0, steps=range(1, 3), end_ns=100 * MS)
    assert turn.latencies_ms == pytest.approx([100.0, 2.0])
    assert (turn.missing, turn.incomplete) == (1, 1)


def test_steps_are_due_when_the_plant_thinks_so() -> None:
    from lsu_mesh.mesh.nodes.schedule import Schedule

    schedule = Schedule(1_700_000_000_000_000_000, 30.0)
    assert [intended_ns(1_700_000_000_000_000_000, 30.0, k) for k in range(1, 50)] == [
        schedule.time_of(k) for k in range(1, 50)
    ]
