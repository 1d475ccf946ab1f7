"""What a verification finds, in words that name the set and the field."""

from __future__ import annotations

from typing import Any, NamedTuple


class Difference(NamedTuple):
    """A recorded set that is not what its provenance gives; ``field`` names the first number or claim that differs."""

    peer: str
    topic: str
    step: int
    seq: int
    field: str
    recorded: Any
    recomputed: Any

    def __str__(self) -> str:
        place = f"{self.peer}, step {self.step}, {self.field} of {self.topic} {self.seq}"
        return f"{place}: {self.recorded!r} in the recording, {self.recomputed!r} recomputed"


class Missing(NamedTuple):
    """A recorded set that cannot be recomputed, and why."""

    peer: str
    topic: str
    step: int
    seq: int
    reason: str

    def __str__(self) -> str:
        return f"{self.peer}, step {self.step}, {self.topic} {self.seq}: {self.reason}"
