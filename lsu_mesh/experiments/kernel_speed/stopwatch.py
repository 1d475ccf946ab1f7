"""Times of competing programs on one core.

They run in turns, so that the noise of a shared machine hits all alike, and the clock is the processor time of this
process, all threads together: on one core that is the wall clock of an idle machine.
"""

from __future__ import annotations

import contextlib
import gc
import os
import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

MAX_CALLS = 100_000


class Candidate(NamedTuple):
    """``run()`` does ``units`` of work (steps, hulls); the time is per unit."""

    run: Callable[[], object]
    units: int = 1


@contextlib.contextmanager
def one_core() -> Iterator[int | None]:
    """Keep this process on one of its cores, and yield which; ``None`` where the system cannot do that."""
    if not hasattr(os, "sched_setaffinity"):
        yield None
        return
    before = os.sched_getaffinity(0)
    core = max(before)
    os.sched_setaffinity(0, {core})
    try:
        yield core
    finally:
        os.sched_setaffinity(0, before)


def compare(candidates: Mapping[str, Candidate], rounds: int, seconds: float) -> dict[str, float]:
    """Median processor seconds per unit of each candidate over the rounds; it runs about ``seconds`` in each."""
    calls = {name: _calls(candidate, seconds) for name, candidate in candidates.items()}
    times: dict[str, list[float]] = {name: [] for name in candidates}
    collecting = gc.isenabled()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, candidate in candidates.items():
                times[name].append(_seconds(candidate, calls[name]) / (calls[name] * candidate.units))
            gc.collect()
    finally:
        if collecting:
            gc.enable()
    return {name: statistics.median(taken) for name, taken in times.items()}


def _calls(candidate: Candidate, seconds: float) -> int:
    """How many calls fill the time; the first call, which may compile, is not counted."""
    candidate.run()
    calls = 1
    while True:
        taken = _seconds(candidate, calls)
        if taken >= 0.2 * seconds or calls >= MAX_CALLS:
            return max(1, min(MAX_CALLS, round(calls * seconds / max(taken, 1e-9))))
        calls *= 4


def _seconds(candidate: Candidate, calls: int) -> float:
    run = candidate.run
    began = time.process_time()
    for _ in range(calls):
        run()
    return time.process_time() - began
