"""What comes of recomputing one set: the fields of its message, and what its claims rest on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from lsu_mesh.mesh.messages import Posterior, Prediction

Fields = Mapping[str, Any]
"""Fields of a message and their values."""
OF_POINTS = ("point", "y_point", "point_rule", "mean", "covariance")
"""Fields that rest on the rule of the points."""
DataStatus = Literal["ok", "predicted", "inconsistent"]


@dataclass(frozen=True)
class Recomputed:
    """A set again: the ``fields`` of its message that hold numbers, and what its claims rest on.

    ``status`` is that of its step's data alone; ``is_widened``: whether r was widened since its base; ``outvoted``:
    sources that contradict those that were used, ``None`` where that cannot be told.
    """

    fields: Fields
    status: DataStatus = "ok"
    is_widened: bool = False
    outvoted: frozenset[str] | None = field(default_factory=frozenset)


def told_by(recorded: Posterior | Prediction, fields: Fields) -> Fields:
    """The fields without those of points where a message, of an older peer, does not say how its point was chosen."""
    if recorded.point_rule is not None:
        return fields
    return {name: value for name, value in fields.items() if name not in OF_POINTS}
