"""What ends a simulated run."""

from __future__ import annotations


class InvariantBroken(Exception):
    """A promise of the mesh was not kept; ``invariant`` is the promise in a word or two."""

    def __init__(self, invariant: str, text: str) -> None:
        super().__init__(f"{invariant}: {text}")
        self.invariant = invariant
