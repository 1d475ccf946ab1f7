"""All comparisons in one run, and what is demanded of them."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from typing import Any, NamedTuple

from lsu_mesh.experiments.kernel_speed.constrained_steps import (
    ConstrainedStep,
    GeneratorCost,
    constrained_step,
    generator_costs,
)
from lsu_mesh.experiments.kernel_speed.hulls import HullCost, SafeBounds, hull_cost, safe_bounds
from lsu_mesh.experiments.kernel_speed.start import FirstStep, first_step, modules_of_import
from lsu_mesh.experiments.kernel_speed.steps import BankSpeed, StepCost, bank_speed, step_costs
from lsu_mesh.experiments.kernel_speed.stopwatch import one_core
from lsu_mesh.experiments.machine_facts import Facts, processor, releases

PACKAGES = ("numpy", "scipy", "numba", "highspy", "zonoopt", "filterpy")
JUDGED = 3
"""Number of states of the system (P3) whose step is compared with plain NumPy."""


class Effort(NamedTuple):
    """Numbers of states and generators, sets, bank instances, rounds, seconds of a candidate in a round, processes."""

    sizes: tuple[int, ...]
    generators: tuple[int, ...]
    sets: int
    instances: int
    rounds: int
    seconds: float
    processes: int


FULL = Effort(
    sizes=(2, 3, 6, 12, 30),
    generators=(10, 15, 20, 30, 40, 60),
    sets=20,
    instances=10_000,
    rounds=9,
    seconds=0.03,
    processes=5,
)
QUICK = Effort(sizes=(2, 3), generators=(10, 20), sets=5, instances=1_000, rounds=3, seconds=0.005, processes=1)


class Demand(NamedTuple):
    """A number that is demanded: ``measured`` against ``limit``; ``met`` is ``None`` where it could not be measured."""

    what: str
    measured: float | None
    relation: str
    limit: float
    met: bool | None


class Report(NamedTuple):
    """Everything that was measured."""

    machine: Facts
    steps: list[StepCost]
    bank: BankSpeed
    hull: HullCost
    safe_bounds: SafeBounds
    constrained_step: ConstrainedStep
    generators: list[GeneratorCost]
    imported: list[str]
    first_steps: list[FirstStep]
    demands: list[Demand]


def measure(effort: Effort, tell: Callable[[str], None] = lambda words: None) -> Report:
    """Run everything on one core; ``tell`` is called with what comes next."""
    rounds, seconds = effort.rounds, effort.seconds
    with one_core() as core:
        tell("a step of each filter")
        steps = step_costs(effort.sizes, rounds, seconds)
        tell("a bank")
        bank = bank_speed(effort.instances, 20, rounds, seconds)
        tell("hulls")
        hull = hull_cost(effort.sets, rounds, seconds)
        tell("safe bounds")
        safe = safe_bounds(effort.sets, rounds, seconds)
        tell("a step of LSUCZ")
        step = constrained_step(effort.sets, rounds, seconds)
        tell("cost against generators")
        generators = generator_costs(effort.generators, rounds, seconds)
        tell("new processes")
        imported = modules_of_import()
        first = [first_step(kind, effort.processes) for kind in ("LSUO", "LSUCZ")]
    demands = _demands(steps, bank, hull, safe=safe, step=step, first=first)
    return Report(
        machine=_machine(core),
        steps=steps,
        bank=bank,
        hull=hull,
        safe_bounds=safe,
        constrained_step=step,
        generators=generators,
        imported=imported,
        first_steps=first,
        demands=demands,
    )


def as_dictionary(report: Report) -> dict[str, Any]:
    """The report as plain dictionaries and lists, for JSON."""

    def plain(value: Any) -> Any:
        if isinstance(value, tuple) and hasattr(value, "_asdict"):
            return {name: plain(entry) for name, entry in value._asdict().items()}
        return [plain(entry) for entry in value] if isinstance(value, list) else value

    made: dict[str, Any] = plain(report)
    return made


def _demands(
    steps: list[StepCost], bank: BankSpeed, hull: HullCost, safe: SafeBounds, step: ConstrainedStep,
    first: list[FirstStep],
) -> list[Demand]:  # fmt: skip
    judged = {cost.kind: cost for cost in steps if cost.n == JUDGED}
    own = hull.seconds["own"]
    exact = [hull.difference[name] for name in ("linprog", "highspy") if name in hull.difference]
    return [
        _at_least(
            "LSUO on P3: plain NumPy ÷ compiled loop",
            _ratio(judged["LSUO"].numpy, judged["LSUO"].loop),
            100.0,
        ),
        _at_least("LSUP on P3: plain NumPy ÷ compiled loop", _ratio(judged["LSUP"].numpy, judged["LSUP"].loop), 50.0),
        _at_least("hull (20, 8), n = 3: linprog ÷ ours", _ratio(hull.seconds.get("linprog"), own), 100.0),
        _at_least("hull (20, 8), n = 3: warm highspy ÷ ours", _ratio(hull.seconds.get("highspy"), own), 10.0),
        _at_most("hull: difference from linprog and highspy, relative", max(exact) if exact else None, 1e-9),
        _at_least("step of LSUCZ(20, 8): zonoopt ÷ ours", _ratio(step.zonoopt, step.own), 20.0),
        _at_least("bank of LSUO on P3: steps a second on one core", bank.steps_per_second, 1e6),
        _at_most("safe bounds: share of a hull's time", safe.share, 0.1),
        _at_most("safe bounds: loss, relative", safe.loss, 1e-12),
        _at_most("new process with a first step of LSUO: processor seconds", first[0].processor, 1.0),
    ]


def _ratio(other: float | None, own: float | None) -> float | None:
    return None if other is None or own is None else other / own


def _at_least(what: str, measured: float | None, limit: float) -> Demand:
    return Demand(
        what=what, measured=measured, relation="≥", limit=limit, met=None if measured is None else measured >= limit
    )


def _at_most(what: str, measured: float | None, limit: float) -> Demand:
    return Demand(
        what=what, measured=measured, relation="≤", limit=limit, met=None if measured is None else measured <= limit
    )


def _machine(core: int | None) -> Facts:
    return {
        "processor": processor(), "cores": os.cpu_count(), "pinned_to": core, "python": platform.python_version()
    } | releases(PACKAGES)  # fmt: skip
