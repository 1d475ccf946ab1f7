"""Checks of what a filter is given at a step, and the arrays that its kernels take."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Array, Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.kernels.discretisation.step_charges import charge
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support


class KernelModel(NamedTuple):
    """A model as kernels take it: writable, contiguous, no ``None``.

    A (n, n), ``B = [B  a]`` (n, p + 1), or (n, p) without offset, C (m, n), ``G = [N  B]`` (n, q + p) with the columns
    of everything unknown, rho (q,), r (m,), and widths (q + p,) of the columns of G where the input is known. With
    radii the last n columns of N are the identity.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    G: Matrix
    rho: Vector
    r: Vector
    widths: Vector


def kernel_model(model: LSUModel) -> KernelModel:
    """The arrays of ``model``; the identity stands for a missing noise map, no column for a missing B."""
    if not isinstance(model, LSUModel):
        raise ModelError(
            f"a filter takes the model of a step, not {model!r}: of a continuous one give .discretised(ns)"
        )
    n = model.state_count
    B = np.zeros((n, 0)) if model.B is None else model.B
    N = np.eye(n) if model.noise_map is None else model.noise_map
    rho = np.array(model.rho)
    if model.radii is not None and not np.array_equal(N[:, -n:], np.eye(n)):
        N, rho = np.hstack([N, np.eye(n)]), np.concatenate([rho, np.zeros(n)])
    return KernelModel(
        A=np.array(model.A),
        B=np.array(B) if model.a is None else np.hstack([B, model.a.reshape(n, 1)]),
        C=np.array(model.C),
        G=np.ascontiguousarray(np.hstack([N, B])),
        rho=rho,
        r=np.array(model.r),
        widths=np.concatenate([rho, np.zeros(model.input_count)]),
    )


@functools.lru_cache(maxsize=64)
def step_arrays(model: LSUModel) -> KernelModel:
    """:func:`kernel_model` of a model of one step, kept for the next step of the same length."""
    return kernel_model(model)


def driven(
    model: LSUModel,
    arrays: KernelModel,
    u: ArrayLike | Orthotope | None,
    rho: ArrayLike | None,
    bounds: Callable[[], tuple[Vector, Vector]],
) -> tuple[Vector, Vector]:
    """What drives a step from a set with these bounds: u (p,), a last 1 for the offset; the widths (q + p,) of G.

    Where the model has radii, what they charge, ``radii.A |x| + radii.B |u| + radii.a``, is among the widths.
    """
    if rho is None and not isinstance(u, Orthotope):
        center, widths = input_vector(u, model.input_count), arrays.widths
    else:
        center, half_widths = input_interval(u, model.input_count)
        given = half_width_vector("rho", rho, arrays.rho[: model.rho.size])
        widths = np.concatenate([given, np.zeros(arrays.rho.size - given.size), half_widths])
    if model.radii is not None:
        A, B, a = (np.array(radius) for radius in model.radii)
        lower, upper = (np.array(side) for side in bounds())
        widths, n, q = np.array(widths), lower.size, arrays.rho.size
        charge(A, B, a, lower, upper, center, widths[q:].copy(), widths, q - n)
    return center if model.a is None else np.append(center, 1.0), widths


def with_offset(model: LSUModel, U: Matrix) -> Matrix:
    """Inputs (…, p) as kernels take them, with a last column of ones where the model has an offset."""
    return U if model.a is None else np.concatenate([U, np.ones((*U.shape[:-1], 1))], axis=-1)


def numbers(name: str, value: ArrayLike) -> Array:
    """An array of floats, NaN where an entry is masked; ``ModelError`` with the name where it holds no real numbers."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value.copy()
    try:
        given = value if isinstance(value, np.ndarray) else np.asarray(value)
        has_mask = isinstance(given, np.ma.MaskedArray) or (not isinstance(value, np.ndarray) and _has_mask(value))
        if has_mask:
            given = np.ma.asarray(np.ma.array(value))
        is_number = given.dtype.kind in "biuf" or (given.dtype.kind == "O" and not _has_text(given)) or not given.size
        found = np.ma.filled(given.astype(np.float64), np.nan) if is_number else None
    except (TypeError, ValueError) as error:
        raise ModelError(f"{name} must hold real numbers in rows of equal length: {error}") from error
    if found is None:
        raise ModelError(f"{name} must hold real numbers, it holds {given.dtype}")
    return np.array(found, dtype=np.float64)


def _has_mask(value: object) -> bool:
    """Whether rows or entries of a sequence are masked: numpy would take their data."""
    if isinstance(value, np.ma.MaskedArray):
        return True
    return isinstance(value, (list, tuple)) and any(map(_has_mask, value))


def _has_text(given: Array) -> bool:
    return any(isinstance(entry, (str, bytes)) for entry in given.flat)


def output_vector(y: ArrayLike, size: int) -> Vector:
    """y (m,) with NaN for missing entries; ``ModelError`` on a wrong length or an infinite entry."""
    values = numbers("y", y)
    if values.ndim == 0 and size == 1:
        values = values.reshape(1)
    if values.shape != (size,):
        raise ModelError(f"y must have {size} entries, one per output, it has shape {values.shape}")
    if np.isinf(values).any():
        raise ModelError(f"y must be finite or NaN (missing), it is {values.tolist()}")
    return values


def half_width_vector(name: str, given: ArrayLike | None, default: Vector) -> Vector:
    """Half-widths of this step, ``default`` where none are given; a scalar stands for all entries."""
    if given is None:
        return default
    values = numbers(name, given)
    if values.ndim == 0:
        values = np.full(default.size, float(values))
    if values.shape != default.shape:
        raise ModelError(f"{name} must have {default.size} entries, it has shape {values.shape}")
    if not (np.isfinite(values).all() and (values >= 0).all()):
        raise ModelError(f"{name} must be finite and not negative, it is {values.tolist()}")
    return values


def input_interval(u: ArrayLike | Orthotope | None, size: int) -> tuple[Vector, Vector]:
    """Centre and half-widths (p,) of the input; a vector has half-widths 0.

    Raises ``ModelError`` where an input is needed and missing, or of wrong length.
    """
    if isinstance(u, Orthotope):
        if u.dim != size:
            raise ModelError(f"the box of inputs must have {size} coordinates, it has {u.dim}")
        return np.array(u.center), np.array(u.half_widths)
    return input_vector(u, size), np.zeros(size)


def input_vector(u: ArrayLike | None, size: int) -> Vector:
    """u (p,); ``ModelError`` where it is needed and missing, or of wrong length."""
    if u is None:
        if size:
            raise ModelError(f"the model has {size} input(s): give u, or an Orthotope that holds the unknown input")
        return np.zeros(0)
    values = numbers("u", u)
    if values.ndim == 0 and size == 1:
        values = values.reshape(1)
    if values.shape != (size,):
        raise ModelError(f"u must have {size} entries, one per input, it has shape {values.shape}")
    if not np.isfinite(values).all():
        raise ModelError(f"u must be finite (a missing input is an Orthotope), it is {values.tolist()}")
    return values


def same_states(model: LSUModel, step_model: LSUModel | None) -> LSUModel:
    """The model of this step, which must have as many states as the filter's."""
    if step_model is None:
        return model
    if step_model.state_count != model.state_count:
        raise ModelError(f"the model of a step must have {model.state_count} states, it has {step_model.state_count}")
    return step_model


def checked_prior(model: LSUModel, prior: Support | tuple[ArrayLike, ArrayLike]) -> Support:
    """The prior, a set in the space of the states; a pair stands for the box (lower, upper).

    Raises ``ModelError`` where it is no set or has another dimension.
    """
    if isinstance(prior, tuple) and len(prior) == 2:
        prior = Orthotope(*prior)
    if not isinstance(prior, Support):
        raise ModelError(f"the prior must be a support such as Orthotope(lower, upper), not {type(prior).__name__}")
    if prior.dim != model.state_count:
        raise ModelError(f"the prior must have {model.state_count} coordinates, one per state, it has {prior.dim}")
    return prior
