"""Cost against size: sources of a fusion, states of a filter, instances of a bank. No network."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lsu_mesh.experiments.mesh_speed.benchmark_mesh import FUSION, configuration, mesh_values
from lsu_mesh.experiments.mesh_speed.local_steps import local_steps
from lsu_mesh.experiments.mesh_speed.throughput import LEAD, RATE, Run, in_turns, node_run, operation_run
from lsu_mesh.filters.bank import FilterBank
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.mesh.config import load_values
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.systems import get

PROCESSES, RELAY = "processes of a mesh", "processes of the relay"
SOURCES, BANK = "sources of a fusion", "instances of a bank"
STATE_KINDS = ("LSUO", "LSUP", "LSUCZ")
BANK_ROWS = 20


class Effort(NamedTuple):
    """Sizes, timed steps of a node in a round, rounds, seconds of a bank in a round, and of a mesh."""

    filters: tuple[int, ...]
    sources: tuple[int, ...]
    states: tuple[int, ...]
    instances: tuple[int, ...]
    steps: int
    rounds: int
    seconds: float
    mesh_seconds: float


FULL = Effort(
    filters=(1, 4, 8, 12), sources=(2, 4, 8, 12), states=(3, 6, 12, 24), instances=(1, 10, 100, 1000, 10_000),
    steps=60, rounds=3, seconds=0.05, mesh_seconds=5.0,
)  # fmt: skip
QUICK = Effort(
    filters=(1, 2), sources=(2, 3), states=(3, 4), instances=(1, 10),
    steps=5, rounds=1, seconds=0.002, mesh_seconds=1.0,
)  # fmt: skip


@dataclass(frozen=True)
class Cost:
    """One point: what grows, how much of it there is, and what it costs, in ``unit``."""

    what: str
    count: int
    cost: float
    unit: str
    kept_up: bool = True
    """False: processes that lost steps, so that a step costs more than this."""

    def line(self) -> dict[str, Any]:
        """What ``--json`` prints and a file of results keeps."""
        return {"type": "scale", **asdict(self), "cost": float(f"{self.cost:.4g}")}


def states_of(kind: str) -> str:
    """What grows in the rows of a filter's states."""
    return f"states, {kind}"


def source_costs(counts: Sequence[int], steps: int, rounds: int) -> list[Cost]:
    """Microseconds of a step of a fusion, decoding and encoding included, against its sources."""
    runs = {}
    for count in counts:
        mesh = configuration(RATE, count)
        runs[count] = node_run(mesh, "fusion", FUSION, steps=local_steps(mesh, LEAD + steps))
    return _costs(SOURCES, runs, rounds, unit="µs a step")


def state_costs(counts: Sequence[int], steps: int, rounds: int) -> list[Cost]:
    """Microseconds of a step of a filter node, decoding and encoding included, against its states."""
    found = []
    for k, kind in enumerate(STATE_KINDS):
        runs = {}
        for count in counts:
            values = mesh_values(RATE, len(STATE_KINDS), states=count)
            del values["fusion"]  # its linear programs of so many states would take the time of the measurement
            mesh = load_values(values, Path("bench.toml"))
            runs[count] = node_run(mesh, "filter", f"f{k + 1}", steps=local_steps(mesh, LEAD + steps))
        found += _costs(states_of(kind), runs, rounds, unit="µs a step")
    return found


def bank_costs(counts: Sequence[int], rounds: int, seconds: float) -> list[Cost]:
    """Microseconds of a step of all instances of a bank of LSUO on P3, with one thread."""
    return _costs(BANK, {count: _bank(count, seconds) for count in counts}, rounds, unit="µs a step of all")


def _bank(instances: int, seconds: float) -> Run:
    model, random = get("P3"), np.random.default_rng(1)
    Y = random.uniform(-1.0, 1.0, (instances, BANK_ROWS, model.output_count)) * model.r
    U = np.zeros((instances, BANK_ROWS, model.input_count))
    priors = [Orthotope([-1.0] * 3, [1.0] * 3)] * instances
    bank = FilterBank(LSUO, model, priors, threads=1, point="centre")
    timed = operation_run(lambda: bank.run(Y, U), seconds)

    def run() -> tuple[int, float]:
        calls, taken = timed()
        return calls * BANK_ROWS, taken

    return run


def _costs(what: str, runs: Mapping[int, Run], rounds: int, *, unit: str) -> list[Cost]:
    """The median over the rounds."""
    rates = in_turns({str(count): run for count, run in runs.items()}, rounds)
    return [Cost(what, int(count), 1e6 / statistics.median(found), unit) for count, found in rates.items()]
