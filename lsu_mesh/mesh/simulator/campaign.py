"""Many seeds in several processes."""

from __future__ import annotations

import gc
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
COLLECTED_AFTER = 200_000
"""New objects after which a process looks for circles among them: runs make many objects and hardly a circle."""


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
        before = gc.get_threshold()
        gc.set_threshold(COLLECTED_AFTER)
        try:
            yield from map(one, seeds)
        finally:
            gc.set_threshold(*before)
        return
    with multiprocessing.get_context("spawn").Pool(workers, _begin_worker) as pool:
        yield from pool.imap(one, seeds, chunksize=CHUNK)


def _begin_worker() -> None:
    """Interrupts are the parent's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(COLLECTED_AFTER)


def _one(file: Path, steps: int, faults: tuple[str, ...], seed: int) -> Outcome:
    return run_seed(file, seed, steps, faults)
