"""Up to which sequence number everything of a key has been stored."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

WINDOW = 4096
"""A number that is still missing when so many later ones have come is given up, and counted as lost."""

MAX_BOOTS = 16
"""Earlier lives of a key that are remembered."""
MAX_HOLES = 256
"""Holes that are remembered, the newest."""


@dataclass
class _Run:
    """Numbers of one (key, boot) from ``first`` on: all up to ``complete`` have come or are lost, some after it."""

    boot: str
    first: int
    complete: int
    newest: int
    beyond: set[int] = field(default_factory=set)
    lost: list[tuple[int, int]] = field(default_factory=list)
    """Holes that were given up: first and last number of each."""


class Ledger:
    """Counts per key, from the first number that came: up to ``flushed[key]`` nothing is missing but what is lost.

    Numbers of another boot start a new count, which is published from the next flush on.
    """

    def __init__(self) -> None:
        self._runs: dict[str, _Run] = {}
        self._old: dict[str, deque[str]] = {}
        self._reported: dict[str, _Run] = {}
        """What ``flushed`` counts; until the next flush that may be an earlier boot."""
        self.flushed: dict[str, int] = {}

    def record(self, key: str, boot: str, seq: int) -> None:
        """A message was taken; it is stored with the next flush."""
        run = self._runs.get(key)
        if run is None or run.boot != boot:
            old = self._old.setdefault(key, deque(maxlen=MAX_BOOTS))
            if boot in old:
                return  # a straggler of an earlier life: stored, but that life is not counted any more
            if run is not None:
                old.append(run.boot)
            self._runs[key] = _Run(boot, seq, seq, seq)
        elif seq > run.complete:
            run.beyond.add(seq)
            run.newest = max(run.newest, seq)
            _complete(run)

    def boot(self, key: str) -> str:
        """The boot that ``flushed`` counts."""
        return self._reported[key].boot

    def first(self, key: str) -> int:
        """The first number that came of that boot."""
        return self._reported[key].first

    def lost(self, key: str) -> list[tuple[int, int]]:
        """Holes of that boot that were given up: first and last number of each."""
        return self._reported[key].lost

    def is_lost(self, key: str, seq: int) -> bool:
        """Whether a number of that boot was given up."""
        return any(first <= seq <= last for first, last in self.lost(key))

    def flush(self) -> None:
        """Everything that was noted is stored now."""
        self._reported = dict(self._runs)
        self.flushed = {key: run.complete for key, run in self._runs.items()}


def _complete(run: _Run) -> None:
    while run.beyond:
        if run.complete + 1 not in run.beyond:
            if run.newest - run.complete <= WINDOW:
                return
            following = min(run.beyond)
            run.lost = [*run.lost[1 - MAX_HOLES :], (run.complete + 1, following - 1)]
            run.complete = following - 1
        run.complete += 1
        run.beyond.remove(run.complete)
