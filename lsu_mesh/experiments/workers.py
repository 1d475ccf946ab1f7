"""Work that is spread over all cores, and how far it has come."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeAlias, TypeVar

Watch: TypeAlias = Callable[[float], None]
"""Receives the share of the work that is done, from 0 to 1."""
Item = TypeVar("Item")
Result = TypeVar("Result")
_SHARED: ContextVar[ProcessPoolExecutor | None] = ContextVar("shared", default=None)


def unwatched(share: float) -> None:
    """For those who do not watch."""


def part(watch: Watch, first: float, last: float) -> Watch:
    """The watch of a piece of work that reaches from ``first`` to ``last`` of the whole."""
    return lambda share: watch(first + share * (last - first))


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def spread(
    function: Callable[[Item], Result], items: Sequence[Item], watch: Watch = unwatched, processes: int | None = None
) -> list[Result]:
    """``[function(item) for item in items]`` over as many processes as there are cores; results in order.

    The function is one of a module, and items and results can be pickled. The result does not depend on the number of
    processes.
    """
    workers = min(len(items), processes or cores())
    if workers <= 1:
        return [_watched(function, item, watch, (i + 1) / len(items)) for i, item in enumerate(items)]
    shared = _SHARED.get()
    if shared is not None and processes is None:
        return _submit(shared, function, items, watch)
    with _pool(workers) as pool:
        return _submit(pool, function, items, watch)


@contextmanager
def shared_processes() -> Iterator[None]:
    """Every :func:`spread` in this context uses the same processes, which then start, and import, only once."""
    with _pool(cores()) as pool:
        token = _SHARED.set(pool)
        try:
            yield
        finally:
            _SHARED.reset(token)


def _pool(workers: int) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_leave_interrupts_to_the_parent)


def _submit(
    pool: ProcessPoolExecutor, function: Callable[[Item], Result], items: Sequence[Item], watch: Watch
) -> list[Result]:
    waiting = [pool.submit(function, item) for item in items]
    try:
        for done, finished in enumerate(as_completed(waiting), 1):
            finished.result()
            watch(done / len(items))
    except BaseException:
        for job in waiting:
            job.cancel()
        raise
    return [finished.result() for finished in waiting]


def _watched(function: Callable[[Item], Result], item: Item, watch: Watch, share: float) -> Result:
    result = function(item)
    watch(share)
    return result


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
