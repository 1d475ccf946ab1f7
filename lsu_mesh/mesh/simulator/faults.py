"""What goes wrong in one simulated run: a plan that is a function of the seed."""

from __future__ import annotations

import random
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.simulator.external_sensor import ClockStep

START_NS = 10_000 * SECOND
"""True time at which step 1 is due; far from zero, so that no wrong clock is negative."""
MESSAGE_FAULTS = ("drop", "delay", "duplicate", "reorder", "corrupt")
FAULTS = (*MESSAGE_FAULTS, "partition", "freeze", "kill", "skew")
HIGHEST_RATE = {"drop": 0.15, "delay": 0.1, "duplicate": 0.1, "reorder": 0.2, "corrupt": 0.04}
"""Share of a link's messages that a fault hits at the most."""
MAX_OUTAGES = {"partition": 2, "freeze": 3, "kill": 4}
SHORTEST_OUTAGE_NS, MAX_OUTAGE_NS = SECOND // 20, 3 * SECOND
MAX_SKEW_NS = 2 * SECOND
MAX_DRIFT = 2e-4
"""Seconds that a bad clock gains or loses in a second."""
MEMBERSHIP = 0.75
"""Chance that a fault that is allowed takes part in a run: fewer kinds at once reach other states than all of them."""


@dataclass(frozen=True)
class Outage:
    """Peers that are cut off, frozen or dead from ``begin`` to ``end`` (nanoseconds of true time)."""

    names: frozenset[str]
    begin: int
    end: int


@dataclass(frozen=True)
class Skew:
    """A peer's clock: ``true + offset + drift · (true − start)``."""

    offset: int = 0
    drift: float = 0.0


@dataclass(frozen=True)
class FaultPlan:
    """Faults of one run; no new one begins after ``end``."""

    end: int
    rates: dict[str, float] = field(default_factory=dict)
    """Share of the messages on each link that each kind of fault hits."""
    partitions: Sequence[Outage] = ()
    freezes: Sequence[Outage] = ()
    kills: Sequence[Outage] = ()
    skews: dict[str, Skew] = field(default_factory=dict)
    clock_steps: Mapping[str, Sequence[ClockStep]] = field(default_factory=dict)
    """Of external sensors."""

    @property
    def total_rate(self) -> float:
        """Share of the messages that any fault hits."""
        return sum(self.rates.values())


def parse_faults(text: str) -> tuple[str, ...]:
    """``all``, ``none``, or names with commas between; ``ValueError`` names the one that is unknown."""
    if text in ("all", "none"):
        return FAULTS if text == "all" else ()
    chosen = tuple(name.strip() for name in text.split(",") if name.strip())
    for name in chosen:
        if name not in FAULTS:
            raise ValueError(f"no fault {name!r}; faults: all, none, {', '.join(FAULTS)}")
    return tuple(name for name in FAULTS if name in chosen)


def draw_plan(
    rng: random.Random, allowed: Collection[str], peers: Sequence[tuple[str, str]], begin: int, end: int
) -> FaultPlan:
    """A plan for ``peers`` (role, name) between two times."""
    chosen = [kind for kind in FAULTS if kind in allowed and rng.random() < MEMBERSHIP]
    if not chosen:
        chosen = [kind for kind in FAULTS if kind in allowed][:1]
    names = [name for _, name in peers]
    rates = {kind: HIGHEST_RATE[kind] * rng.random() ** 2 for kind in chosen if kind in MESSAGE_FAULTS}
    outages = {
        kind: _draw_outages(rng, kind, names, begin=begin, end=end) if kind in chosen else ()
        for kind in ("partition", "freeze", "kill")
    }
    skews = {}
    if "skew" in chosen:
        skews = {
            name: Skew(rng.randint(-MAX_SKEW_NS, MAX_SKEW_NS), rng.uniform(-MAX_DRIFT, MAX_DRIFT))
            for role, name in peers
            if role != "plant" and rng.random() < 0.5
        }
    return FaultPlan(
        end=end,
        rates=rates,
        partitions=outages["partition"],
        freezes=outages["freeze"],
        kills=outages["kill"],
        skews=skews,
    )


def _draw_outages(rng: random.Random, kind: str, names: Sequence[str], begin: int, end: int) -> tuple[Outage, ...]:
    outages = []
    for _ in range(rng.randint(1, MAX_OUTAGES[kind])):
        size = rng.randint(1, len(names) - 1) if kind == "partition" else 1
        length = round(SHORTEST_OUTAGE_NS * (MAX_OUTAGE_NS / SHORTEST_OUTAGE_NS) ** rng.random())
        first = rng.randint(begin, max(begin, end - length))
        outages.append(Outage(frozenset(rng.sample(names, size)), first, min(end, first + length)))
    return tuple(outages)
