"""Quantiles of measured times: values that were measured, none between two of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple


class Quantiles(NamedTuple):
    """p50, p99, p99.9 and the largest of so many samples, in the unit of the samples."""

    samples: int
    p50: float
    p99: float
    p999: float
    largest: float


def quantile(ordered: Sequence[float], permille: int) -> float:
    """The smallest sample that at least ``permille`` in 1000 samples do not exceed (nearest rank).

    It is the sample number ``⌈permille · n / 1000⌉`` of ``n`` samples in ascending order, without interpolation. A rank
    beyond what n samples can tell is the largest one: p99.9 of fewer than 1000 samples is their maximum.

    Raises
    ------
    ValueError
        Without samples, or for ``permille`` outside of 1 … 1000.
    """
    if not ordered:
        raise ValueError("no samples: a quantile needs at least one")
    if not 1 <= permille <= 1000:
        raise ValueError(f"permille: expected 1 … 1000, found {permille}")
    return ordered[-(-permille * len(ordered) // 1000) - 1]


def quantiles(samples: Sequence[float]) -> Quantiles:
    """All quantiles of samples in any order; ``ValueError`` without samples."""
    ordered = sorted(samples)
    p50, p99, p999 = (quantile(ordered, permille) for permille in (500, 990, 999))
    return Quantiles(len(ordered), p50, p99, p999, largest=ordered[-1])
