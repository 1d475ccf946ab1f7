"""What an estimator knows of one step, and what came of its data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from lsu_mesh.filters.filter import GainOf
from lsu_mesh.mesh.estimation.held_set import Held
from lsu_mesh.mesh.estimation.time_update import Origin
from lsu_mesh.mesh.messages import Fused, Input, Measurement, Message, Posterior, Prediction, Reference, Smoothed

Status = Literal["ok", "predicted", "inconsistent", "restarted"]


@dataclass
class Step:
    """What is known of one step."""

    arrived: dict[str, Message] = field(default_factory=dict)
    """Newest message of each source."""
    data: list[Measurement] = field(default_factory=list)
    """Every measurement, in the order of arrival, without copies."""
    origin: Origin | None = None
    """The posterior of the step before, where data between the steps can be reached from it."""
    input: Input | None = None
    before: Held | None = None
    """What was held before the step's data, for rewinding."""
    transfers: Sequence[Prediction | Fused] | None = None
    """Transfers used when the step was first closed; a replay uses the same."""
    closed: bool = False
    """Whether its data were combined once; they are never waited for again."""
    revision: int = -1
    published: Posterior | None = None
    smoothed: Smoothed | None = None
    """What was published with it of the state some steps back."""

    def takes(self, message: Measurement) -> bool:
        """Note a measurement; False for one with the moment and the values of another of its sensor, a copy."""
        content = (message.name, _moment(message), message.y)
        if any((one.name, _moment(one), one.y) == content for one in self.data):
            return False
        self.data.append(message)
        return True

    def untimed(self, sensor: str) -> Measurement | None:
        """What a sensor has sent of the step without a time of its own."""
        return next((one for one in self.data if one.name == sensor and one.time_error_ns is None), None)


def _moment(message: Measurement) -> tuple[int, int] | None:
    return None if message.time_error_ns is None else (message.time_ns, message.time_error_ns)


@dataclass(frozen=True)
class Combined:
    """Outcome of one step's data."""

    status: Status
    used: Sequence[Reference]
    missing: Sequence[str]
    origin: int | None
    cause: str | None = None
    gain: float | None = None
    gain_of: GainOf | None = None


def published_content(posterior: Posterior) -> tuple[object, ...]:
    """What makes a step worth telling again when it changes: the set, its density and its worth, and who is not in it.

    Later sets name the published one as their base, so they must descend from what it says.
    """
    box = posterior.lower, posterior.upper
    beside = posterior.mean, posterior.covariance
    rejected = (posterior.rejected,) if isinstance(posterior, Fused) else ()
    claims = posterior.status, posterior.epoch, posterior.descent, posterior.guarantee, posterior.missing
    return posterior.support, box, beside, *claims, *rejected
