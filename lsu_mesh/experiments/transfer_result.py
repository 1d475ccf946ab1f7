"""One point of the transfer experiment's curves."""

from __future__ import annotations

from typing import NamedTuple


class Result(NamedTuple):
    """One point of the curves; ratios are to the isolated filter."""

    system: str
    kind: str
    way: str
    ratio: float
    """r_S ÷ r"""
    width: float
    """Mean width, mean over coordinates."""
    widest: float
    """Mean width of the coordinate that has gained least."""
    worst_step: float
    """Largest ratio of widths in any step and coordinate: a filter of limited complexity is not monotone."""
    tnse: float
    """Total norm-squared error of all steps and seeds; ``tnse_ratio`` is to that of the isolated filter."""
    tnse_ratio: float
    gain: float
    """Mean nats by the hulls; ``support_gain`` by the supports."""
    support_gain: float
    inside: float
    rejected: float
    restarts: float
