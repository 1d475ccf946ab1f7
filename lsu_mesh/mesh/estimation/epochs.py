"""Epochs: which sets of others may still be used, and what the own set descends from.

An epoch is one peer's ``(src, boot, number)``; a reset abandons it and opens the next. A set *descends* from every
epoch whose sets went into it, its own and those of others, directly or through others. Messages list these epochs. So
two filters that use each other's sets both leave an abandoned epoch, and neither takes it over from the other again.
"""

from __future__ import annotations

from collections.abc import Iterator

from lsu_mesh.mesh.messages import Mark, Posterior, Prediction

Peer = tuple[str, str]
"""``(src, boot)``: epochs of a process that was started again are counted anew."""
MAX_BOOTS = 16
"""Boots of one source whose epochs are remembered."""


class Epochs:
    """The newest known epoch of every peer, and those that the own set descends from."""

    def __init__(self, src: str, boot: str) -> None:
        self._own: Peer = (src, boot)
        self.number = 0
        """The own epoch."""
        self._newest: dict[Peer, int] = {self._own: 0}
        self._relied: dict[Peer, int] = {}

    @property
    def descent(self) -> list[Mark]:
        """Marks of the epochs of others that the own set descends from, sorted."""
        return [(src, boot, number) for (src, boot), number in sorted(self._relied.items())]

    @property
    def abandoned(self) -> str | None:
        """A source that has abandoned an epoch from which the own set descends, or ``None``."""
        return next((src for (src, boot), n in sorted(self._relied.items()) if n < self._newest[src, boot]), None)

    def record(self, message: Posterior | Prediction) -> None:
        """Remember the epoch of a message, and those that its set descends from."""
        for src, boot, number in _marks(message):
            self._newest[src, boot] = max(number, self._newest.get((src, boot), 0))
        self._forget_old_boots(message.src)

    def is_abandoned(self, message: Posterior | Prediction) -> bool:
        """Whether the message's set descends from an epoch that is known to be abandoned."""
        return any(number < self._newest.get((src, boot), 0) for src, boot, number in _marks(message))

    def is_descendant(self, message: Posterior | Prediction) -> bool:
        """Whether the message's set descends from the own present epoch."""
        return (*self._own, self.number) in message.descent

    def add_dependency(self, message: Posterior | Prediction) -> None:
        """Note that the message's set went into the own one."""
        for src, boot, number in _marks(message):
            if (src, boot) != self._own:
                self._newest[src, boot] = max(number, self._newest.get((src, boot), 0))
                self._relied[src, boot] = max(number, self._relied.get((src, boot), 0))

    def begin(self) -> None:
        """Abandon the own epoch: the own set descends from nothing now."""
        self.number += 1
        self._newest[self._own] = self.number
        self._relied.clear()

    def snapshot(self) -> dict[Peer, int]:
        """What the own set descends from, for :meth:`restore`."""
        return dict(self._relied)

    def restore(self, snapshot: dict[Peer, int]) -> None:
        """The own set is an earlier one of the same epoch again."""
        self._relied = dict(snapshot)

    def continue_from(self, number: int) -> None:
        """Continue the numbers of an earlier process of this name."""
        self.number = self._newest[self._own] = max(self.number, number)

    def _forget_old_boots(self, src: str) -> None:
        if len(self._newest) <= MAX_BOOTS:
            return
        boots = [peer for peer in self._newest if peer[0] == src and peer != self._own and peer not in self._relied]
        for peer in boots[: max(0, len(boots) - MAX_BOOTS)]:
            del self._newest[peer]


def _marks(message: Posterior | Prediction) -> Iterator[Mark]:
    yield message.src, message.boot, message.epoch
    yield from message.descent
