"""Checks of what a filter is given: prior, outputs, inputs and bounds of one step."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.errors import ModelError
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.arrays import finite_array
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Vector = NDArray[np.float64]


def prior_support(prior: Support | tuple[ArrayLike, ArrayLike], n: int) -> Support:
    """The prior as a set of dimension n; a pair is the box ``(lower, upper)``. Raises ``ModelError``."""
    if not isinstance(prior, Support):
        try:
            lower, upper = prior
        except (TypeError, ValueError) as error:
            raise ModelError(f"prior must be a set or a pair (lower, upper), it is {prior!r}") from error
        prior = Orthotope(lower, upper)
    if prior.dim != n:
        raise ModelError(f"the prior must have {n} coordinates, one per state, it has {prior.dim}")
    return prior


def output_data(model: LSUModel, y: ArrayLike, r: ArrayLike | None) -> tuple[Vector, Vector]:
    """Outputs (m,), NaN = missing, and their half-widths (m,). Raises ``ModelError``."""
    m = model.output_count
    values = np.array(y, dtype=np.float64)
    if values.shape != (m,):
        raise ModelError(f"y must have {m} entries, one per output, it has shape {values.shape}")
    if np.isinf(values).any():
        raise ModelError(f"y must hold finite numbers, or NaN for a missing output, it is {values.tolist()}")
    return values, half_widths("r", model.r if r is None else r, m)


def half_widths(name: str, value: ArrayLike, size: int) -> Vector:
    """Half-widths (size,), finite and ≥ 0; a scalar stands for all. Raises ``ModelError``."""
    array = np.array(value, dtype=np.float64)
    if array.ndim == 0:
        array = np.full(size, float(array))
    array = np.array(finite_array(name, array, (size,)))
    if (array < 0).any():
        raise ModelError(f"{name} must not be negative, it is {array.tolist()}")
    return array


def input_box(model: LSUModel, u: ArrayLike | Orthotope | None) -> tuple[Vector, Vector]:
    """Centre and half-widths (p,) of the input: a vector has none. Raises ``ModelError``."""
    p = model.input_count
    if u is None:
        if p:
            raise ModelError(f"the model has {p} input(s): give u, or a box that holds it")
        return np.zeros(0), np.zeros(0)
    if isinstance(u, Orthotope):
        if u.dim != p:
            raise ModelError(f"the input box must have {p} coordinate(s), it has {u.dim}")
        return np.array(u.center), np.array(u.half_widths)
    return np.array(finite_array("u", u, (p,))), np.zeros(p)


def step_model(model: LSUModel, override: LSUModel | None) -> LSUModel:
    """The model of this step; its states must be those of the filter. Raises ``ModelError``."""
    if override is None:
        return model
    if override.state_count != model.state_count:
        raise ModelError(f"the model of this step must have {model.state_count} states, it has {override.state_count}")
    return override
