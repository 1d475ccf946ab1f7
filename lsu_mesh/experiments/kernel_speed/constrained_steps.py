"""A whole step of LSUCZ, hull included, beside the same operations of zonoopt; cost against generators."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from lsu_mesh.experiments.kernel_speed.hulls import own_hull, random_set
from lsu_mesh.experiments.kernel_speed.other_libraries import installed, zonoopt_step
from lsu_mesh.experiments.kernel_speed.stopwatch import Candidate, compare
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.simulation import simulate
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.systems import get

GENERATORS, CONSTRAINTS = 20, 8
FIRST = 20
"""Rows of data after which the set is as complex as its limits allow."""

Step = Callable[[], tuple[np.ndarray, np.ndarray]]


class ConstrainedStep(NamedTuple):
    """Mean seconds of a step, and mean width of zonoopt's boxes ÷ ours, ``None`` where it is not installed."""

    steps: int
    own: float
    zonoopt: float | None
    width_ratio: float | None


class GeneratorCost(NamedTuple):
    """Seconds of one hull of g generators and 2g/5 constraints in dimension 3, and of a step of LSUCZ so limited."""

    generators: int
    constraints: int
    hull: float
    step: float


def constrained_step(steps: int, rounds: int, seconds: float) -> ConstrainedStep:
    """Steps 21, 22, … of LSUCZ(20, 8) on P3, each from the same posterior for both."""
    own, other = _steps(GENERATORS, CONSTRAINTS, steps, beside_zonoopt=installed("zonoopt"))
    candidates = {"own": Candidate(functools.partial(_all, own), steps)}
    if other:
        candidates["zonoopt"] = Candidate(functools.partial(_all, other), steps)
    cost = compare(candidates, rounds, seconds)
    ratios = [_width(theirs()) / _width(ours()) for ours, theirs in zip(own, other, strict=False)]
    return ConstrainedStep(steps, cost["own"], cost.get("zonoopt"), float(np.mean(ratios)) if ratios else None)


def generator_costs(counts: Sequence[int], rounds: int, seconds: float) -> list[GeneratorCost]:
    """Cost against the number of generators."""
    costs = []
    for g in counts:
        m = 2 * g // 5
        hulls = [own_hull(*random_set(seed, g=g, m=m)) for seed in range(5)]
        own, _ = _steps(g, m, 5, beside_zonoopt=False)
        candidates = {
            "hull": Candidate(functools.partial(_all, hulls), len(hulls)),
            "step": Candidate(functools.partial(_all, own), len(own)),
        }
        costs.append(GeneratorCost(g, m, **compare(candidates, rounds, seconds)))
    return costs


def _steps(generators: int, constraints: int, steps: int, *, beside_zonoopt: bool) -> tuple[list[Step], list[Step]]:
    """Time update, data update and hull of ``steps`` steps of P3, by LSUCZ and by zonoopt."""
    model = get("P3")
    data = simulate(model, FIRST + steps + 1, seed=1)
    engine = LSUCZ(model, Orthotope([-1.0] * 3, [1.0] * 3), generators, constraints, point="centre")
    own, other = [], []
    for k in range(FIRST + steps):
        engine.update(data.Y[k])
        if k >= FIRST:
            u, y = data.U[k], data.Y[k + 1]
            own.append(_own_step(engine, engine.snapshot(), u, y))
            if beside_zonoopt:
                other.append(zonoopt_step(model, engine.support.arrays, u, y=y, max_constraints=constraints))
        engine.predict(data.U[k])
    return own, other


def _own_step(engine: LSUCZ, start: object, u: np.ndarray, y: np.ndarray) -> Step:
    def step() -> tuple[np.ndarray, np.ndarray]:
        engine.restore(start)
        engine.predict(u)
        engine.update(y)
        return engine.bounds()

    return step


def _all(steps: Sequence[Step]) -> None:
    for step in steps:
        step()


def _width(box: tuple[np.ndarray, np.ndarray]) -> float:
    return float((box[1] - box[0]).sum())
