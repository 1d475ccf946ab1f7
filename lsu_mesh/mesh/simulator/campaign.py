"""Many seeds in several processes."""

from __future__ import annotations

import multiprocessing
import signal
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from lsu_mesh.mesh.simulator.run import Outcome, run_seed

CHUNK = 4
"""Seeds that a process takes at once."""


@dataclass
class Tally:
    """The sum over all seeds so far."""

    seeds: int = 0
    steps: int = 0
    sets: int = 0
    broken: list[Outcome] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def add(self, outcome: Outcome) -> None:
        """One more seed."""
        self.seeds += 1
        self.steps += outcome.steps
        self.sets += outcome.sets
        self.counts.update(outcome.counts)
        if outcome.broken:
            self.broken.append(outcome)


def run_seeds(
    file: Path, seeds: Sequence[int], steps: int, faults: Collection[str], workers: int = 1
) -> Iterator[Outcome]:
    """Outcomes in the order of the seeds."""
    one = partial(_one, file, steps, tuple(faults))
    if workers <= 1 or len(seeds) <= CHUNK:
        yield from map(one, seeds)
        return
    with multiprocessing.get_context("spawn").Pool(workers, _leave_interrupts_to_the_parent) as pool:
        yield from pool.imap(one, seeds, chunksize=CHUNK)


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _one(file: Path, steps: int, faults: tuple[str, ...], seed: int) -> Outcome:
    return run_seed(file, seed, steps, faults)
