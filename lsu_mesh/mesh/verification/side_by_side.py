"""The sets of a recording compared by several processes at once, each with peers of its own."""

from __future__ import annotations

import gc
import multiprocessing
import pickle
import signal
import sys
import traceback
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from typing import Any

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.verification.archive import Archive
from lsu_mesh.mesh.verification.comparison import Comparison, Outcome, Recorded

MAX_PROCESSES = 16
"""So many processes at most: each has the recording, as far as it changes what it reads."""
AT_ONCE = 64
"""So many outcomes are sent together."""


def compared(
    configuration: Configuration, archive: Archive, sets: Sequence[Recorded], processes: int
) -> Iterator[Outcome]:
    """What comes of each set, in order; the same whatever the number of processes.

    The sets of one peer are recomputed one after another, those of different peers rest on messages only: a process for
    each peer, up to :data:`MAX_PROCESSES`, where there is more than one core and processes can be forked.
    """
    peers = Counter(one.src for one in sets)
    count = min(len(peers), MAX_PROCESSES)
    if processes < 2 or count < 2 or not sys.platform.startswith("linux"):
        comparison = Comparison(configuration, archive)
        for one in sets:
            yield comparison.compare(one)
        return
    place = {src: i % count for i, (src, _) in enumerate(peers.most_common())}
    gc.freeze()  # what is shared is not searched, and so not copied
    workers = [
        _Worker(configuration, archive, [one for one in sets if place[one.src] == number]) for number in range(count)
    ]
    try:
        for one in sets:
            yield workers[place[one.src]].next()
    finally:
        for worker in workers:
            worker.end()
        gc.unfreeze()


class _Worker:
    """A process that compares some of the sets, in order."""

    def __init__(self, configuration: Configuration, archive: Archive, sets: Sequence[Recorded]) -> None:
        context: Any = multiprocessing.get_context("fork")  # the recording is there already, and is not sent
        self._outcomes: deque[Outcome] = deque()
        self._answers, answers = context.Pipe(duplex=False)
        self._process = context.Process(target=_compare_all, args=(configuration, archive, sets, answers), daemon=True)
        self._process.start()
        answers.close()

    def next(self) -> Outcome:
        """The outcome of the next set. Raises ``RuntimeError`` where the process has failed."""
        if not self._outcomes:
            try:
                answer = pickle.loads(self._answers.recv_bytes())
            except EOFError:
                raise RuntimeError("a process that recomputes sets has ended before its work was done") from None
            if isinstance(answer, str):
                raise RuntimeError(f"a process that recomputes sets has failed:\n{answer}")
            self._outcomes.extend(answer)
        return self._outcomes.popleft()

    def end(self) -> None:
        """End the process, whether or not it has finished."""
        self._answers.close()
        self._process.terminate()
        self._process.join()


def _compare_all(configuration: Configuration, archive: Archive, sets: Sequence[Recorded], answers: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its children
    gc.disable()
    try:
        comparison = Comparison(configuration, archive)
        for first in range(0, len(sets), AT_ONCE):
            outcomes = [comparison.compare(one) for one in sets[first : first + AT_ONCE]]
            answers.send_bytes(pickle.dumps(outcomes))
    except BrokenPipeError:  # the parent has stopped
        pass
    except Exception:  # told to the parent, which raises it
        answers.send_bytes(pickle.dumps(traceback.format_exc()))
