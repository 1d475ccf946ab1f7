"""The rules by which a point estimate is chosen."""

from __future__ import annotations

from typing import Literal, get_args

from lsu_mesh.errors import ModelError

PointRule = Literal["mean", "nearest", "centre"]
"""``"mean"``: the point of the set nearest to the mean of a density beside it; ``"nearest"``: that nearest to the
set's centre; ``"centre"``: the centre itself, which may lie outside."""
PointOption = Literal["mean", "nearest", "centre", "hull"]
"""A :data:`PointRule`, or ``"hull"``, the name that ``"centre"`` had before."""


def point_rule(option: str) -> PointRule:
    """The rule that an option names; ``ModelError`` for another word."""
    if option == "hull":
        return "centre"
    if option not in get_args(PointRule):
        raise ModelError(f'point must be "mean", "nearest" or "centre", it is {option!r}')
    return option  # type: ignore[return-value]
