"""Sensors of others in a simulated mesh: clocks that jump, restarts, copies and reorderings make no set wrong."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.simulator.external_sensor import (
    LEAST_STEP_NS,
    MAX_STEP_NS,
    ClockStep,
    ExternalSensor,
    draw_clock_steps,
    with_simulated_plant,
)
from lsu_mesh.mesh.simulator.faults import FAULTS, START_NS
from lsu_mesh.mesh.simulator.run import run_seed

MESH = """
[mesh]
name = "own"
dt = 0.1
[model]
continuous = true
A = [[0.0, 1.0], [0.0, 0.0]]
noise_map = [[0.0], [1.0]]
rho = [2.0]
[model.prior]
lower = [-10.0, -5.0]
upper = [10.0, 5.0]
[model.domain]
lower = [-10000.0, -500.0]
upper = [10000.0, 500.0]
[sensors.gauge]
source = "external"
C = [[1.0, 0.0]]
r = [0.5]
[sensors.speed]
source = "external"
C = [[0.0, 1.0]]
r = [0.2]
time_error = "5ms"
[filters.box]
kind = "LSUO"
sensors = ["gauge", "speed"]
[filters.cz]
kind = "LSUCZ"
sensors = ["gauge", "speed"]
[fusion.main]
sources = ["box", "cz"]
"""
STEPS = 160


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    file = tmp_path / "mesh.toml"
    file.write_text(MESH)
    return file


@pytest.mark.parametrize("seed", range(1, 5))
def test_every_set_holds_the_truth_and_all_is_well_in_the_end(mesh: Path, seed: int) -> None:
    outcome = run_seed(mesh, seed, STEPS, FAULTS)
    assert outcome.broken == ""
    assert outcome.sets > 100
    assert outcome.counts["clock step"] == 0 or outcome.counts["untrue time"] > 0


def test_times_that_are_believed_although_they_cannot_be_true_break_sets(mesh: Path) -> None:
    """What refuses them is what keeps the sets: believed, a clock that is behind by ten seconds makes them wrong."""
    mesh.write_text(MESH.replace("dt = 0.1", "dt = 0.1\nfuture = 7200\npast = 7200").replace("LSUO", "LSUPB"))
    outcomes = (run_seed(mesh, seed, 400, ("kill",)) for seed in range(1, 20))
    assert next(outcome.broken for outcome in outcomes if outcome.broken).startswith("containment")


def test_clocks_jump_by_ten_seconds_to_an_hour_and_are_set_right_in_time() -> None:
    rng = random.Random(1)
    for _ in range(200):
        for steps in draw_clock_steps(rng, ["a", "b"], 5 * SECOND, 20 * SECOND).values():
            for step in steps:
                assert 5 * SECOND <= step.begin <= step.end <= 20 * SECOND
                assert LEAST_STEP_NS <= abs(step.offset_ns) <= MAX_STEP_NS


def test_a_sensor_stamps_by_its_own_clock_and_measures_what_is(mesh: Path) -> None:
    configuration = with_simulated_plant(load(mesh), START_NS)
    begin, end = START_NS + 4 * SECOND, START_NS + 6 * SECOND
    steps = (ClockStep(begin, end, 3600 * SECOND),)
    node = ExternalSensor(configuration, "gauge", "0" * 16, clock_steps=steps, steps=101)
    told, now = [], START_NS
    while now < START_NS + 12 * SECOND:
        told += [(now, message) for message in node.advance(now)]
        wakeup = node.wakeup()
        assert wakeup is not None
        now = max(now + 1, wakeup)
    assert {message.time_ns - at for at, message in told} == {0, 3600 * SECOND}
    assert all((message.time_ns != at) == (begin <= at < end) for at, message in told)
    assert {message.step for _, message in told} == {0}
    assert max(at for at, _ in told) <= START_NS + 10 * SECOND, "no plant beyond the last step"


@pytest.mark.soak
@pytest.mark.timeout(7200)
def test_a_thousand_faults_of_external_sensors(mesh: Path) -> None:
    """Kills, restarts and clock steps; copies and reorderings are counted besides."""
    faults = copies = 0
    for seed in range(1000, 1220):
        outcome = run_seed(mesh, seed, STEPS, FAULTS)
        assert outcome.broken == "", seed
        faults += outcome.counts["kill"] + outcome.counts["clock step"]
        copies += outcome.counts.get("duplicate", 0) + outcome.counts.get("reorder", 0)
    assert faults >= 1000
    assert copies >= 1000
