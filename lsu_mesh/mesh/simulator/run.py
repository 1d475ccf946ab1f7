"""One seed: draw the mesh and its faults, run them, and compare the end with a run in which nothing went wrong."""

from __future__ import annotations

import functools
import random
import traceback
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Posterior
from lsu_mesh.mesh.nodes.plant_course import PlantCourse
from lsu_mesh.mesh.simulator.broken import InvariantBroken
from lsu_mesh.mesh.simulator.external_sensor import draw_clock_steps
from lsu_mesh.mesh.simulator.faults import FaultPlan, draw_plan
from lsu_mesh.mesh.simulator.invariants import Invariants
from lsu_mesh.mesh.simulator.mesh import SimulatedMesh
from lsu_mesh.mesh.simulator.time_variants import draw_times
from lsu_mesh.mesh.simulator.variants import WORTH, Variant, configured, draw_lag, draw_variant

TRAJECTORIES = 4
"""So many different trajectories of the plant; the fault-free run of each is kept."""
RECOVERY_STEPS = 100
"""So many steps (5 s) after the last fault the mesh is as if nothing had been."""
JUDGED_STEPS = 20
"""The steps after those, the last of a run, in which it is judged."""
WIDEST, WIDEST_SMALL = 1.05, 1.5
"""A fused set may then be so much wider than without faults: in the mesh as it is, and with small constrained
zonotopes, whose size hangs on what was reduced when, for as long as anything of it is remembered."""
WIDEST_LIVE = 3.0
"""Sensors that measure when they like measure at other moments after a restart."""
AFTERMATH = 10
"""Steps of time after the last step, in which deadlines pass."""


@dataclass(frozen=True)
class Outcome:
    """What came of one seed."""

    seed: int
    steps: int
    broken: str = ""
    """The invariant that was broken, and how; empty when all held."""
    sets: int = 0
    """Sets that were checked."""
    counts: dict[str, int] = field(default_factory=dict)
    """Faults that happened, by kind."""
    variant: str = ""


def run_seed(file: Path, seed: int, steps: int, faults: Collection[str]) -> Outcome:
    """Simulate one seed."""
    rng = random.Random(seed)
    base = configured(file, steps, 0, Variant())
    variant = draw_variant(rng, base)
    if variant.kinds:
        times = draw_times(random.Random(f"{seed}/times"), base)
        variant = variant._replace(times=times, lag=draw_lag(random.Random(f"{seed}/lag"), base, times))
        if variant.transfer[1] == "predictor":
            variant = variant._replace(publish_when=random.Random(f"{seed}/worth").choice(WORTH))
    trajectory = rng.randrange(TRAJECTORIES)
    configuration = configured(file, steps, trajectory, variant)
    witness = Invariants(configuration, true_states(configuration, steps + AFTERMATH))
    last_faulty = max(steps // 2, steps - RECOVERY_STEPS - JUDGED_STEPS)
    begin, end = (SimulatedMesh.start_time(configuration, step) for step in (0, last_faulty))
    plan = draw_plan(rng, faults, configuration.peers(), begin=begin, end=end)
    plan = with_wrong_clocks(plan, configuration, random.Random(f"{seed}/clocks"), begin=begin) if faults else plan
    mesh = SimulatedMesh(configuration, plan, rng, witness)
    broken = ""
    try:
        mesh.run(steps + AFTERMATH)
        if steps - last_faulty >= RECOVERY_STEPS + JUDGED_STEPS:
            widths = fault_free_widths(file, steps, trajectory, variant)
            _check_end(configuration, witness, widths, _widest(configuration, variant))
    except InvariantBroken as error:
        broken = str(error)
    except Exception as error:  # a node that dies of a message is a finding, not the end of the campaign
        broken = f"crash: {type(error).__name__}: {error}\n{traceback.format_exc(limit=-4)}"
    counts = mesh.transport.counts | {
        "partition": len(plan.partitions), "freeze": len(plan.freezes), "kill": len(plan.kills),
        "skew": len(plan.skews),
        "clock step": sum(map(len, plan.clock_steps.values())),
        "untrue time": witness.untrue_times,
    }  # fmt: skip
    return Outcome(seed=seed, steps=steps, broken=broken, sets=witness.sets, counts=counts, variant=str(variant))


def _widest(configuration: Configuration, variant: Variant) -> float:
    if configuration.mesh.is_live:
        return WIDEST_LIVE
    return WIDEST_SMALL if variant.kinds else WIDEST


def with_wrong_clocks(plan: FaultPlan, configuration: Configuration, rng: random.Random, *, begin: int) -> FaultPlan:
    """The plan with clocks of external sensors that jump; other clocks then err by less than is believed."""
    live = {name for name, sensor in configuration.sensors.items() if sensor.is_live}
    if not live:
        return plan
    believed = configuration.mesh.future_ns // 2
    skews = {
        name: replace(skew, offset=max(-believed, min(believed, skew.offset)))
        for name, skew in plan.skews.items()
        if name not in live
    }
    return replace(plan, skews=skews, clock_steps=draw_clock_steps(rng, live, begin, plan.end))


@functools.lru_cache(maxsize=512)
def fault_free_widths(file: Path, steps: int, trajectory: int, variant: Variant) -> dict[str, float]:
    """Mean width of each estimator's judged sets when nothing goes wrong."""
    configuration = configured(file, steps, trajectory, variant)
    witness = Invariants(configuration, true_states(configuration, steps + AFTERMATH))
    SimulatedMesh(configuration, FaultPlan(0), random.Random(0), witness).run(steps + AFTERMATH)
    return {name: judged_width(name, newest, steps) for name, newest in witness.newest.items()}


def true_states(configuration: Configuration, steps: int) -> NDArray[np.float64]:
    """What the plant of a configuration does, (steps, n)."""
    course = PlantCourse(configuration)
    x = course.first
    X = np.empty((steps, x.size))
    for k in range(1, steps + 1):
        X[k - 1] = x
        x = course.next(k, x)
    return X


def judged_width(name: str, newest: dict[int, Posterior], steps: int) -> float:
    """Mean width of the bounds over the judged steps."""
    widths = []
    for k in range(steps - JUDGED_STEPS + 1, steps + 1):
        if k not in newest:
            raise InvariantBroken("recovery", f"{name} has published no step {k}")
        widths.append(np.mean(np.subtract(newest[k].upper, newest[k].lower)))
    return float(np.mean(widths))


def _check_end(configuration: Configuration, witness: Invariants, widths: dict[str, float], widest: float) -> None:
    """Healthy, complete, and as narrow as without faults."""
    for _, name in configuration.peers():
        health = witness.health.get(name)
        if health is None or health.level != "OK":
            words = "is not there" if health is None else f"is {health.level}: {'; '.join(health.reasons)}"
            raise InvariantBroken("health", f"{name} {words} in the end")
    for name, expected in widths.items():
        found = judged_width(name, witness.newest.get(name, {}), int(configuration.mesh.steps or 0))
        if name in configuration.fusion and found > widest * expected:
            raise InvariantBroken(
                "recovery", f"{name} has mean width {found:.6g} in the end, without faults {expected:.6g}"
            )
