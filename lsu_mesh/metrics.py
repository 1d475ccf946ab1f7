"""How good estimates and sets are, measured against the truth or against exact sets."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.array_types import Vector
from lsu_mesh.supports.support import Support


def tnse(estimate: ArrayLike, truth: ArrayLike) -> float:
    """Total norm-squared error ``Σ_t Σ_j (ẑ_tj − z_tj)²``; both (T, n). Source: Lainová et al. 2019, eq. (49)."""
    return float(np.square(_errors(estimate, truth)).sum())


def rmse(estimate: ArrayLike, truth: ArrayLike) -> float:
    """Root of the mean over steps of the squared Euclidean error; both (T, n)."""
    errors = _errors(estimate, truth)
    return float(np.sqrt(np.square(errors).sum(axis=-1).mean()))


def mae(estimate: ArrayLike, truth: ArrayLike) -> Vector:
    """Mean absolute error of each coordinate, (n,); both (T, n)."""
    return np.asarray(np.abs(_errors(estimate, truth)).mean(axis=0))


def inside(lower: ArrayLike, upper: ArrayLike, truth: ArrayLike) -> NDArray[np.bool_]:
    """At which steps the interval holds the truth in every coordinate, (T,); all (T, n). No tolerance."""
    values = np.asarray(truth, dtype=np.float64)
    return np.asarray(((np.asarray(lower) <= values) & (values <= np.asarray(upper))).all(axis=-1))


def containment(lower: ArrayLike, upper: ArrayLike, truth: ArrayLike) -> float:
    """Share of steps at which the interval holds the truth; all (T, n)."""
    return float(inside(lower, upper, truth).mean())


def support_containment(supports: Iterable[Support], truth: ArrayLike) -> float:
    """Share of steps at which the *set* may hold the truth (T, n): 1 unless exclusion is proved somewhere."""
    rows = np.asarray(truth, dtype=np.float64)
    return float(np.mean([support.contains(x) for support, x in zip(supports, rows, strict=True)]))


def mean_width(lower: ArrayLike, upper: ArrayLike) -> Vector:
    """Mean width of each coordinate's interval, (n,); both (T, n)."""
    return np.asarray((np.asarray(upper, dtype=np.float64) - np.asarray(lower, dtype=np.float64)).mean(axis=0))


def hull_tightness(support: Support, exact: Support) -> float:
    """Mean over coordinates of width ÷ exact width; a coordinate in which the exact set is flat is left out."""
    lower, upper = support.bounds()
    exact_lower, exact_upper = exact.bounds()
    widths = exact_upper - exact_lower
    wide = widths > 0
    return float(((upper - lower)[wide] / widths[wide]).mean()) if wide.any() else 1.0


def volume_tightness(support: Support, exact: Support) -> float:
    """Volume ÷ exact volume; 1 where both are flat."""
    exact_volume = exact.volume()
    if exact_volume > 0:
        return support.volume() / exact_volume
    return 1.0 if support.volume() == 0 else float("inf")


def _errors(estimate: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(estimate, dtype=np.float64) - np.asarray(truth, dtype=np.float64)
