"""LSUO and LSUP as one writes them in NumPy: vectorised over states, one strip after the other, not rounded outward.

They do per row of data what :func:`~lsu_mesh.filters.run.run_filter` does: output prediction, data update, interval
hull, volume, time update. Agreement with the compiled filters, up to what those add for rounding, is tested.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.parallelotopes.strip_update import TIE
from lsu_mesh.model import LSUModel


class PlainModel(NamedTuple):
    """A (n, n), B (n, p), C (m, n), rho (n,), r (m,), and |A|, |C|, computed once."""

    A: Matrix
    B: Matrix
    C: Matrix
    rho: Vector
    r: Vector
    abs_A: Matrix
    abs_C: Matrix


class Bounds(NamedTuple):
    """Interval hull (n,), (n,) and volume of the posterior, output interval (m,), (m,) of the prediction before it."""

    lower: Vector
    upper: Vector
    volume: float
    y_lower: Vector
    y_upper: Vector


def plain_model(model: LSUModel) -> PlainModel:
    """The arrays of a model with identity noise map."""
    assert model.B is not None
    assert model.noise_map is None
    A, C = np.array(model.A), np.array(model.C)
    return PlainModel(
        A=A, B=np.array(model.B), C=C, rho=np.array(model.rho), r=np.array(model.r), abs_A=np.abs(A), abs_C=np.abs(C)
    )


def cut(c: Vector, T: Matrix, p: Vector, low: float, high: float) -> tuple[Vector, Matrix]:
    """Parallelotope ``c + T ξ`` (n,), (n, n) around its part in the strip ``low ≤ p'x ≤ high`` (Vicino, Zappa 1996)."""
    g, s = p @ T, p @ c
    sizes = np.abs(g)
    reach = sizes.sum()
    l1, h1 = max(low - s, -reach), min(high - s, reach)
    if l1 > h1:
        raise ValueError("the strip misses the set")
    others = reach - sizes
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - s - others) / sizes, (high - s + others) / sizes
    left = np.where(sizes > 0, np.maximum(-1.0, first), -1.0)
    right = np.where(sizes > 0, np.minimum(1.0, second), 1.0)
    sign = np.where(g < 0, -1.0, 1.0)
    middle, half = 0.5 * sign * (left + right), 0.5 * (right - left)
    k = int(np.argmax(sizes * half))
    if sizes[k] * 2.0 * half[k] <= (h1 - l1) * TIE:  # equal where one face cuts both
        return c + T @ middle, T * half
    direction = T[:, k] / g[k]
    edges = (T - np.outer(direction, g)) * half
    edges[:, k] = direction * (0.5 * (h1 - l1))
    middle[k] = 0.0
    rest = g @ middle
    return c + T @ middle + direction * (0.5 * (l1 + h1) - rest), edges


def lsuo(model: PlainModel, c: Vector, q: Vector, y: Vector, u: Vector) -> tuple[Vector, Vector, Bounds]:
    """One step of LSUO from the box ``c ± q``, each (n,)."""
    center, reach = model.C @ c, model.r + model.abs_C @ q
    new_c, T = c, np.diag(q)
    for p, value, r in zip(model.C, y, model.r, strict=True):
        new_c, T = cut(new_c, T, p, low=value - r, high=value + r)
    radius = np.abs(T).sum(axis=1)
    lower, upper = np.maximum(new_c - radius, c - q), np.minimum(new_c + radius, c + q)
    bounds = Bounds(
        lower=lower, upper=upper, volume=float(np.prod(upper - lower)), y_lower=center - reach, y_upper=center + reach
    )
    next_c = model.A @ (0.5 * (lower + upper)) + model.B @ u
    return next_c, model.abs_A @ (0.5 * (upper - lower)) + model.rho, bounds


def lsup(model: PlainModel, c: Vector, T: Matrix, y: Vector, u: Vector) -> tuple[Vector, Matrix, Bounds]:
    """One step of LSUP with the time update ``"image"`` from the parallelotope ``c + T ξ``, (n,), (n, n)."""
    center, reach = model.C @ c, model.r + np.abs(model.C @ T).sum(axis=1)
    for p, value, r in zip(model.C, y, model.r, strict=True):
        c, T = cut(c, T, p, low=value - r, high=value + r)
    radius = np.abs(T).sum(axis=1)
    volume = 2.0**c.size * abs(float(np.linalg.det(T)))
    bounds = Bounds(lower=c - radius, upper=c + radius, volume=volume, y_lower=center - reach, y_upper=center + reach)
    image = model.A @ T
    return model.A @ c + model.B @ u, image * (1.0 + np.abs(np.linalg.inv(image)) @ model.rho), bounds


def run(
    step: Callable[[PlainModel, Vector, NDArray[np.float64], Vector, Vector], tuple[Vector, Matrix, Bounds]],
    model: PlainModel,
    c: Vector,
    shape: NDArray[np.float64],
    Y: Matrix,
    U: Matrix,
) -> list[Bounds]:
    """All rows of Y (T, m), U (T, p) with :func:`lsuo` (``shape`` = q) or :func:`lsup` (``shape`` = T)."""
    record = []
    for y, u in zip(Y, U, strict=True):
        c, shape, bounds = step(model, c, shape, y, u)
        record.append(bounds)
    return record
