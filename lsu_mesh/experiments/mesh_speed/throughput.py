"""Steps a second of single nodes without a network: decoding, admission, the step, encoding."""

from __future__ import annotations

import functools
import gc
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from lsu_mesh.experiments.mesh_speed.benchmark_mesh import FUSION, NAME, mesh_values
from lsu_mesh.experiments.mesh_speed.local_steps import Step, local_steps, new_node, time_of
from lsu_mesh.mesh.access import subscriptions
from lsu_mesh.mesh.config import Configuration, load_values
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import decode, encode

RATE = 50.0
FILTERS: dict[str, dict[str, Any]] = {
    "LSUO": {"kind": "LSUO"},
    "LSUP": {"kind": "LSUP"},
    "LSUPB": {"kind": "LSUPB"},
    "LSUCZ(20, 8)": {"kind": "LSUCZ", "max_generators": 20, "max_constraints": 8},
    "ZonotopicKalman": {"kind": "ZonotopicKalman"},
}
"""Each reads two sensors of the benchmark mesh."""
FUSED = ("LSUO", "LSUP", "LSUCZ(20, 8)")
FUSION_WORDS = "fusion of three"
DEMANDED = {"LSUO": 6000.0, "LSUCZ(20, 8)": 2500.0}
"""Steps a second on one core of an idle machine."""
LEAD = 40
"""Steps before the clock starts: the sets have their full size then."""
MAX_CALLS = 10**7

Run: TypeAlias = Callable[[], tuple[int, float]]
"""Does some work, and returns how much and the processor seconds it took."""


class Effort(NamedTuple):
    """Timed steps of a node in a round, rounds, and seconds of a plain operation in a round."""

    steps: int
    rounds: int
    seconds: float


FULL, QUICK = Effort(steps=300, rounds=7, seconds=0.1), Effort(steps=20, rounds=1, seconds=0.005)


class Throughput(NamedTuple):
    """One row: how often a second, the median over the rounds and the best of them."""

    what: str
    per_second: float
    best_per_second: float
    demanded: float | None

    @property
    def is_met(self) -> bool | None:
        """Whether the demand is met; ``None`` where there is none."""
        return None if self.demanded is None else self.per_second >= self.demanded

    def line(self) -> dict[str, Any]:
        """What ``--json`` prints and a file of results keeps."""
        rates = {"per_second": round(self.per_second), "best_per_second": round(self.best_per_second)}
        return {"type": "throughput", "what": self.what, **rates, "demanded": self.demanded, "met": self.is_met}


def throughput(effort: Effort, further: Mapping[str, Callable[[], object]] | None = None) -> list[Throughput]:
    """All nodes, decoding and encoding, and ``further`` operations, in turns.

    The clock is the processor time of this process, so that other programs disturb it only through what they share with
    it: caches, and the other half of a core.
    """
    mesh = node_configuration()
    steps = local_steps(mesh, LEAD + effort.steps)
    runs: dict[str, Run] = {}
    for name, words in [*zip(mesh.filters, FILTERS, strict=True), (FUSION, FUSION_WORDS)]:
        role = "fusion" if name == FUSION else "filter"
        runs[words] = node_run(mesh, role, name, steps=steps)
    runs |= {
        what: operation_run(work, effort.seconds) for what, work in {**operations(steps), **(further or {})}.items()
    }
    return [
        Throughput(what, statistics.median(rates), max(rates), DEMANDED.get(what))
        for what, rates in in_turns(runs, effort.rounds).items()
    ]


def node_configuration() -> Configuration:
    """The benchmark mesh with one filter of each kind, and a fusion of three of them."""
    values = mesh_values(RATE, len(FILTERS))
    names = dict(zip(FILTERS, values["filters"], strict=True))
    values["filters"] = {names[words]: {**table, "sensors": ["s1", "s2"]} for words, table in FILTERS.items()}
    values["fusion"] = {FUSION: {"sources": [names[words] for words in FUSED]}}
    return load_values(values, Path("bench.toml"))


def node_run(configuration: Configuration, role: str, name: str, *, steps: Sequence[Step]) -> Run:
    """A new node for each call, which is given what it reads of each step, and whose messages are encoded.

    Fused sets, which filters read only to restart from, are left out.
    """
    listed = subscriptions(configuration, role, name)
    reads = [key(NAME, topic, other) for topic, other in listed if topic != "fused"]
    own = key(NAME, "fused" if role == "fusion" else "posterior", name)

    def run() -> tuple[int, float]:
        node, done, began = new_node(configuration, role, name), 0, 0.0
        node.warm_up()
        for k, step in enumerate(steps, 1):
            if k == LEAD + 1:
                began = time.process_time()
            now = time_of(configuration, k)
            made = [message for address in reads for message in node.deliver(address, step[address], now)]
            made += node.tick(now)
            for message in made:
                encode(message)
                done += node.key(message) == own
        taken = time.process_time() - began
        assert done == len(steps), f"{role} {name}: {done} sets in {len(steps)} steps, so that its time says nothing"
        return len(steps) - LEAD, taken

    return run


def operations(steps: Sequence[Step]) -> dict[str, Callable[[], object]]:
    """Decoding and encoding alone: of a measurement, and of the posterior of the constrained zonotopes."""
    step = steps[-1]
    index = list(FILTERS).index(FUSED[-1])
    payloads = {
        "measurement": step[key(NAME, "measurement", "s1")],
        "posterior": step[key(NAME, "posterior", f"f{index + 1}")],
    }
    found: dict[str, Callable[[], object]] = {}
    for topic, payload in payloads.items():
        words = f"a {topic}" if topic == "measurement" else f"a {topic} of {FUSED[-1]}"
        found[f"decode {words}"] = functools.partial(decode, topic, payload)
        found[f"encode {words}"] = functools.partial(encode, decode(topic, payload))
    return found


def operation_run(work: Callable[[], object], seconds: float) -> Run:
    """Calls for about so many processor seconds; how many that are is found once."""
    calls = 0

    def run() -> tuple[int, float]:
        nonlocal calls
        if not calls:
            calls = 1
            while (taken := _seconds(work, calls)) < 0.2 * seconds and calls < MAX_CALLS:
                calls *= 4
            calls = max(1, min(MAX_CALLS, round(calls * seconds / max(taken, 1e-9))))
        return calls, _seconds(work, calls)

    return run


def _seconds(work: Callable[[], object], calls: int) -> float:
    began = time.process_time()
    for _ in range(calls):
        work()
    return time.process_time() - began


def in_turns(runs: Mapping[str, Run], rounds: int) -> dict[str, list[float]]:
    """How much a second each run did in each round; they take turns, so that noise hits all alike."""
    rates: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            gc.collect()
            count, seconds = run()
            rates[name].append(count / max(seconds, 1e-9))
    return rates
