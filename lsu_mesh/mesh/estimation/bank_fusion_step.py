"""The fused boxes of banks, instance by instance; shared by the node and by the verification."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lsu_mesh.mesh.bank_messages import INCONSISTENT, OK, PREDICTED, RESTARTED, BankPosterior, packed

ALGORITHM = 1
"""Number of this arithmetic."""


def fuse_banks(sources: Sequence[BankPosterior]) -> dict[str, Any]:
    """The fields of a fused message from the posteriors of one step, one per source, at least one.

    ``box_i = ∩ [lower_i, upper_i]`` over the sources that have a set of instance i to believe: minima and maxima, which
    are exact. Where there is none, or the boxes have no common point, instance i is inconsistent, and its box is the
    hull of all sources' boxes, of which nothing is promised. The point is the centre.
    """
    lower = np.array([one.matrix("lower") for one in sources])
    upper = np.array([one.matrix("upper") for one in sources])
    statuses = np.array([one.status_codes for one in sources])
    believed = (statuses != INCONSISTENT)[:, :, np.newaxis]
    low, high = np.where(believed, lower, -np.inf).max(axis=0), np.where(believed, upper, np.inf).min(axis=0)
    failed = ~believed.any(axis=0)[:, 0] | (low > high).any(axis=1)
    low = np.where(failed[:, np.newaxis], lower.min(axis=0), low)
    high = np.where(failed[:, np.newaxis], upper.max(axis=0), high)
    codes = np.where((statuses == RESTARTED).any(axis=0), RESTARTED, PREDICTED)
    codes = np.where((statuses == OK).any(axis=0), OK, codes)
    codes[failed] = INCONSISTENT
    order = ("declared", "learned", "none")
    return {
        "instances": len(low),
        "lower": packed(low),
        "upper": packed(high),
        "point": packed(np.clip(0.5 * low + 0.5 * high, low, high)),
        "statuses": codes.astype(np.uint8).tobytes(),
        "guarantee": max((one.guarantee for one in sources), key=order.index),
        "algorithm": ALGORITHM,
        "policy": "intersect",
        "faults": 0,
        "base": "sources",
        "used": [one.reference for one in sources],
    }
