"""A seeded plant with bounded noise.

Every random value is a function of ``(seed, name, step)`` (counter-based generator Philox), so that a plant or a sensor
that starts again, or starts late, is at the current step at once and draws the same values.
"""

from __future__ import annotations

import functools
import hashlib
import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.kernels import plant_step
from lsu_mesh.model import LSUModel

Noise = Literal["uniform", "corners"]

SINE_PERIOD = 100
"""Steps in one period of the input ``"sine"``."""


class Simulation(NamedTuple):
    """States X (T, n), outputs Y (T, m), inputs U (T, p) of steps 1 … T; row k is step k + 1, U[k] drives it on."""

    X: Matrix
    Y: Matrix
    U: Matrix


def generator(seed: int, name: str, step: int) -> np.random.Generator:
    """The generator of ``(seed, name, step)``: the key comes from seed and name, the counter from the step."""
    counter = np.array([0, step, 0, 0], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(key=_philox_key(seed, name), counter=counter))


@functools.lru_cache(maxsize=1024)
def _philox_key(seed: int, name: str) -> NDArray[np.uint64]:
    return np.frombuffer(hashlib.blake2b(f"{seed}/{name}".encode(), digest_size=16).digest(), dtype="<u8")


def random_uniform(seed: int, name: str, step: int, size: int) -> Vector:
    """``size`` values, uniform on [−1, 1], a function of ``(seed, name, step)``."""
    return 2.0 * generator(seed, name, step).random(size) - 1.0


def random_corner(seed: int, name: str, step: int, size: int) -> Vector:
    """``size`` values −1 or 1, a function of ``(seed, name, step)``."""
    return np.where(generator(seed, name, step).random(size) < 0.5, -1.0, 1.0)


def random_normal(seed: int, name: str, step: int, size: int) -> Vector:
    """``size`` standard normal values, a function of ``(seed, name, step)``."""
    return generator(seed, name, step).standard_normal(size)


def unit_noise(noise: Noise, seed: int, name: str, step: int, size: int) -> Vector:
    """Noise in [−1, 1]: ``"uniform"`` or ``"corners"``."""
    if noise == "uniform":
        return random_uniform(seed, name, step, size)
    if noise == "corners":
        return random_corner(seed, name, step, size)
    raise ModelError(f'noise must be "uniform" or "corners", not {noise!r}')


def input_at(inputs: str, seed: int, step: int, size: int, name: str = "input") -> Vector:
    """u of a step: ``"normal"`` N(0, 1), ``"zero"``, or ``"sine"`` of period ``SINE_PERIOD`` steps."""
    if inputs == "normal":
        return random_normal(seed, name, step, size)
    if inputs == "zero":
        return np.zeros(size)
    if inputs == "sine":
        return np.full(size, math.sin(2.0 * math.pi * step / SINE_PERIOD))
    raise ModelError(f'inputs must be "normal", "zero", "sine" or an array (steps, p), not {inputs!r}')


def next_state(model: LSUModel, x: ArrayLike, u: ArrayLike, unit: Vector) -> Vector:
    """``x⁺ = A x + B u + N (rho · unit)``, x (n,), u (p,), ``|unit| ≤ 1`` (q,).

    Without a noise map the noise is shrunk by the rounding of this very step, so that the stored x⁺ fulfils
    ``|x⁺ − A x − B u| ≤ rho`` in exact arithmetic; where rho is below the rounding, or with a noise map, x⁺ is off by
    that rounding, which every filter's own outward rounding covers.
    """
    n = model.state_count
    out = np.empty(n)
    A = np.array(model.A)
    B = np.zeros((n, 0)) if model.B is None else np.array(model.B)
    state, drive = np.array(x, dtype=np.float64), np.array(u, dtype=np.float64).reshape(model.input_count)
    if model.noise_map is None:
        plant_step.bounded(A, state, B, drive, unit, np.array(model.rho), out)
    else:
        plant_step.mapped(A, state, B, drive, np.array(model.noise_map), unit, np.array(model.rho), out)
    return out


def measure(C: ArrayLike, r: ArrayLike, x: ArrayLike, unit: Vector) -> Vector:
    """``y = C x + r · unit`` (m,), the noise shrunk so that ``|y − C x| ≤ r`` holds exactly; C (m, n), r (m,)."""
    rows, state = np.array(C, dtype=np.float64), np.array(x, dtype=np.float64)
    out = np.empty(rows.shape[0])
    plant_step.bounded(rows, state, np.zeros((rows.shape[0], 0)), np.zeros(0), unit, np.array(r, dtype=np.float64), out)
    return out


def simulate(
    model: LSUModel,
    steps: int,
    seed: int,
    x1: ArrayLike | None = None,
    inputs: str | ArrayLike = "normal",
    noise: Noise = "uniform",
) -> Simulation:
    """Simulate ``steps`` steps from x1 (n,), 0 by default.

    ``inputs``: see :func:`input_at`, or an array (steps, p). ``noise``: ``"uniform"``, or ``"corners"`` for the
    extreme values only. The stored numbers fulfil the declared bounds in exact arithmetic (see :func:`next_state` for
    the exceptions).
    """
    n, m, p, q = model.state_count, model.output_count, model.input_count, model.rho.size
    X, Y = np.empty((steps, n)), np.empty((steps, m))
    U = _inputs(inputs, seed, steps, p)
    x = np.zeros(n) if x1 is None else np.array(x1, dtype=np.float64)
    if x.shape != (n,):
        raise ModelError(f"x1 must have {n} entries, one per state, it has shape {x.shape}")
    for k in range(steps):
        step = k + 1
        X[k] = x
        Y[k] = measure(model.C, model.r, x, unit_noise(noise, seed, "output", step=step, size=m))
        x = next_state(model, x, U[k], unit_noise(noise, seed, "process", step=step, size=q))
    return Simulation(X, Y, U)


def _inputs(inputs: str | ArrayLike, seed: int, steps: int, p: int) -> Matrix:
    if isinstance(inputs, str):
        rows = [input_at(inputs, seed, k + 1, p) for k in range(steps)]
        return np.array(rows).reshape(steps, p)
    given = np.array(inputs, dtype=np.float64)
    if given.shape != (steps, p):
        raise ModelError(f"inputs must have shape {(steps, p)}, it has shape {given.shape}")
    return given
