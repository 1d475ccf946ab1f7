"""What an estimator knows of one step, and what came of its data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from lsu_mesh.mesh.estimation.held_set import Held
from lsu_mesh.mesh.messages import Fused, Input, Message, Posterior, Prediction, Reference

Status = Literal["ok", "predicted", "inconsistent", "restarted"]


@dataclass
class Step:
    """What is known of one step."""

    arrived: dict[str, Message] = field(default_factory=dict)
    """Newest message of each source."""
    input: Input | None = None
    before: Held | None = None
    """What was held before the step's data, for rewinding."""
    transfers: Sequence[Prediction | Fused] | None = None
    """Transfers used when the step was first closed; a replay uses the same."""
    closed: bool = False
    """Whether its data were combined once; they are never waited for again."""
    revision: int = -1
    published: Posterior | None = None


@dataclass(frozen=True)
class Combined:
    """Outcome of one step's data."""

    status: Status
    used: Sequence[Reference]
    missing: Sequence[str]
    origin: int | None
    cause: str | None = None
    gain: float | None = None


def published_content(posterior: Posterior) -> tuple[object, ...]:
    """What makes a step worth telling again when it changes: the set, what it is worth, and who is not in it.

    Later sets name the published one as their base, so they must descend from what it says.
    """
    box = posterior.lower, posterior.upper
    rejected = (posterior.rejected,) if isinstance(posterior, Fused) else ()
    claims = posterior.status, posterior.epoch, posterior.descent, posterior.guarantee, posterior.missing
    return posterior.support, box, *claims, *rejected
