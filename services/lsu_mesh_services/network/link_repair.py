"""Opens the link between two peers again after it broke.

Gossip tells a peer once where another one is. When the connection of two of them breaks, or the first attempt fails,
neither tries again: each takes the other for dead while everybody else hears both. So whoever misses a peer asks an
entry of the mesh, in a session of its own, who is there; and when the missing one is, a second session joins the mesh
for a moment, which makes gossip tell everybody of everybody else again. With access control an entry may not speak for
others: then whoever is missing may be there.
"""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable, Collection
from functools import partial

FIRST_S, SPREAD_S = 0.3, 0.4
"""Until the first question for a lost peer, and how much longer at random: both ends of a link lose each other."""
BEGIN_S = 3.0
"""Until the question whether the first attempts have reached everybody."""
LATE_S = 1.0
"""A peer that is late with its messages looks again after so long whether it may repair links."""
MAX_AGE_S = 30.0
"""Between questions for a peer that stays away; each pause is twice the one before."""


class Absences:
    """Who is there, who is not, and when to ask for them; times in seconds."""

    def __init__(self, begin: float) -> None:
        self._there: set[str] = set()
        self._absent: dict[str, tuple[float, float]] = {}
        """When to ask next, and the pause after that."""
        self._first_look: float | None = begin + BEGIN_S

    def record(self, key: str, is_there: bool, now: float) -> None:
        """A liveliness token has come or gone."""
        if is_there:
            self._there.add(key)
            self._absent.pop(key, None)
        else:
            self._there.discard(key)
            self._absent.setdefault(key, (now + FIRST_S + SPREAD_S * random.random(), FIRST_S))

    def next_at(self) -> float | None:
        """When to ask, if nothing changes."""
        times = [at for at, _ in self._absent.values()]
        times += [] if self._first_look is None else [self._first_look]
        return min(times, default=None)

    def is_due(self, now: float) -> bool:
        """Whether to ask now; plans the next time."""
        late = [key for key, (at, _) in self._absent.items() if at <= now]
        for key in late:
            pause = min(MAX_AGE_S, 2 * self._absent[key][1])
            self._absent[key] = now + pause, pause
        is_first = self._first_look is not None and self._first_look <= now
        if is_first:
            self._first_look = None
        return bool(late) or is_first

    def missed(self, elsewhere: Collection[str] | None, now: float) -> list[str]:
        """Those that are, or may be, there for others; who was never seen here is asked for again from now on."""
        missed = sorted(self._absent if elsewhere is None else set(elsewhere) - self._there)
        for key in missed:
            self.record(key, False, now)
        return missed


class LinkRepair:
    """A thread that sleeps while nobody is missed.

    Parameters
    ----------
    ask:
        The keys of all liveliness tokens that an entry of the mesh knows, this peer's own left out; None where it may
        not tell.
    introduce:
        Joins the mesh with one more session until what it is given returns True.
    is_late:
        Whether the peer gets too little processor for its messages. Then links wait: others may repair them, and a
        session more would make the peer later still.
    """

    def __init__(
        self,
        ask: Callable[[], Collection[str] | None],
        introduce: Callable[[Callable[[], bool]], None],
        is_late: Callable[[], bool] = lambda: False,
    ) -> None:
        self._ask, self._introduce, self._is_late = ask, introduce, is_late
        self._changed = threading.Condition()
        self._absences = Absences(time.monotonic())
        self._is_closed = False
        self.introductions = 0
        """How often another session was needed."""
        self._thread = threading.Thread(target=self._run, name="reunion", daemon=True)
        self._thread.start()

    def record(self, key: str, is_there: bool) -> None:
        """A liveliness token has come or gone; never waits for the network."""
        with self._changed:
            self._absences.record(key, is_there, time.monotonic())
            self._changed.notify()

    def close(self, patience: float = 2.0) -> None:
        """End the thread; a session that it is just opening is left to the end of the process."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        self._thread.join(patience)

    def _run(self) -> None:
        while self._sleep():
            elsewhere = self._ask()
            with self._changed:
                missed = self._absences.missed(elsewhere, time.monotonic())
            if missed and not self._is_closed:
                self.introductions += 1
                self._introduce(partial(self._is_over, missed))

    def _sleep(self) -> bool:
        """Until there is something to ask; False when closed."""
        with self._changed:
            while not self._is_closed:
                at = self._absences.next_at()
                if at is not None and at <= time.monotonic() and self._is_late():
                    self._changed.wait(LATE_S)
                    continue
                if self._absences.is_due(time.monotonic()):
                    return True
                at = self._absences.next_at()
                self._changed.wait(None if at is None else max(0.0, at - time.monotonic()))
        return False

    def _is_over(self, missed: Collection[str]) -> bool:
        with self._changed:
            return self._is_closed or not self._absences.missed(missed, time.monotonic())
