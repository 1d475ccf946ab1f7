"""Up to which sequence number everything of a key has been stored."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

WINDOW = 4096
"""A number that is still missing when so many later ones have come is given up, and counted as lost."""

MOST_BOOTS = 16
"""Earlier lives of a key that are remembered."""
MOST_HOLES = 256
"""Holes that are remembered, the newest."""


@dataclass
class _Run:
    """Numbers of one (key, boot): all up to ``complete`` have come, some after it."""

    complete: int
    newest: int
    beyond: set[int] = field(default_factory=set)


class Ledger:
    """Counts per key, from the first number that came: up to ``flushed[key]`` nothing is missing but ``lost``.

    Numbers of another boot start a new count; the key's newest boot is the one that is told.
    """

    def __init__(self) -> None:
        self._runs: dict[str, tuple[str, _Run]] = {}
        self._old: dict[str, deque[str]] = {}
        self.flushed: dict[str, int] = {}
        self.boots: dict[str, str] = {}
        """The boot that ``flushed`` counts, by key."""
        self.first: dict[str, int] = {}
        """The first number that came of that boot."""
        self.lost: dict[str, list[tuple[int, int]]] = {}
        """Holes of that boot that were given up: first and last number of each."""

    def note(self, key: str, boot: str, seq: int) -> None:
        """A message was taken; it is stored with the next flush."""
        known = self._runs.get(key)
        if known is None or known[0] != boot:
            old = self._old.setdefault(key, deque(maxlen=MOST_BOOTS))
            if boot in old:
                return  # a straggler of an earlier life: stored, but that life is not counted any more
            if known is not None:
                old.append(known[0])
            self._runs[key] = (boot, _Run(seq, seq))
            self.first[key] = seq
            self.lost[key] = []
            return
        run = known[1]
        if seq > run.complete:
            run.beyond.add(seq)
            run.newest = max(run.newest, seq)
            self._complete(key, run)

    def _complete(self, key: str, run: _Run) -> None:
        while run.beyond:
            if run.complete + 1 not in run.beyond:
                if run.newest - run.complete <= WINDOW:
                    return
                following = min(run.beyond)
                self.lost[key] = [*self.lost[key][1 - MOST_HOLES :], (run.complete + 1, following - 1)]
                run.complete = following - 1
            run.complete += 1
            run.beyond.remove(run.complete)

    def is_lost(self, key: str, seq: int) -> bool:
        """Whether a number of the key's present boot was given up."""
        return any(first <= seq <= last for first, last in self.lost[key])

    def flush(self) -> None:
        """Everything that was noted is stored now."""
        for key, (boot, run) in self._runs.items():
            self.flushed[key] = run.complete
            self.boots[key] = boot
