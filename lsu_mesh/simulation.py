"""A seeded plant with bounded noise.

Every random value is a function of ``(seed, name, step)`` (counter-based generator Philox), so that a plant or a sensor
that starts again, or starts late, is at the current step at once and draws the same values.
"""

from __future__ import annotations

import functools
import hashlib
import math
from typing import Literal, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.kernels import plant_step
from lsu_mesh.model import ContinuousModel, LSUModel

Noise = Literal["uniform", "corners"]

NOISE_SHARE = 1.0 - 1e-9
"""Of the noise of a continuous plant: what is left covers the plant's own rounding."""
SINE_PERIOD = 100
"""Steps in one period of the input ``"sine"``."""


class Simulation(NamedTuple):
    """States X (T, n), outputs Y (T, m), inputs U (T, p) of steps 1 … T; row k is step k + 1, U[k] drives it on."""

    X: Matrix
    Y: Matrix
    U: Matrix


class ContinuousSimulation(Simulation):
    """A simulation of a continuous model: row k is of the moment ``times[k] = (k + 1) dt_ns``.

    Within a step the noise is constant, so that the truth between the steps is known, too.
    """

    flow: ContinuousModel
    dt_ns: int
    units: Matrix
    """Noise (T, q) of the steps in shares of rho, row k from step k + 1 on."""

    @property
    def times(self) -> list[int]:
        """Moments (T,) of the rows, in ns."""
        return [(k + 1) * self.dt_ns for k in range(len(self.X))]

    def truth_at(self, time_ns: int) -> Vector:
        """The state (n,) at any moment from times[0] to one step after the last."""
        row, rest = divmod(time_ns, self.dt_ns)
        if not 1 <= row <= len(self.X):
            raise ModelError(f"the simulation goes from {self.dt_ns} to {(len(self.X) + 1) * self.dt_ns - 1} ns")
        return flow_state(self.flow, self.X[row - 1], self.U[row - 1], unit=self.units[row - 1], h_ns=rest)

    def input_at(self, time_ns: int) -> Vector:
        """The input (p,) that acts from this moment on."""
        return np.array(self.U[min(max(time_ns // self.dt_ns, 1), len(self.U)) - 1])


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
    """``x⁺ = A x + B u + a + N (rho · unit)``, x (n,), u (p,), ``|unit| ≤ 1`` (q,).

    Without a noise map the noise is shrunk by the rounding of this very step, so that the stored x⁺ fulfils
    ``|x⁺ − A x − B u| ≤ rho`` in exact arithmetic; where rho is below the rounding, or with a noise map, x⁺ is off by
    that rounding, which every filter's own outward rounding covers.
    """
    n = model.state_count
    A = model.A
    B = np.zeros((n, 0)) if model.B is None else model.B
    state, drive = np.array(x, dtype=np.float64), np.array(u, dtype=np.float64).reshape(model.input_count)
    if model.a is not None:
        B, drive = np.hstack([B, model.a.reshape(n, 1)]), np.append(drive, 1.0)
    if model.noise_map is None:
        return plant_step.bounded(A, state, B, drive, unit, model.rho)
    return plant_step.mapped(A, state, B, drive, model.noise_map, unit, model.rho)


def flow_state(flow: ContinuousModel, x: ArrayLike, u: ArrayLike, unit: Vector, h_ns: int) -> Vector:
    """x (n,) moved on by h_ns ≥ 0 nanoseconds under a constant input u (p,) and noise ``w = rho (1 − 1e-9) unit`` (q,).

    It is ``e^{Ah} x + ∫₀ʰ e^{As} ds (B u + a + N w)`` from the middles of verified enclosures, rounded to doubles. What
    is lost is below the radii that every filter charges for a stretch of the same model, and its own outward rounding;
    where the noise enters, 1e-9 of it is left to cover the rest.
    """
    if h_ns == 0:
        return np.array(x, dtype=np.float64)
    driven = _noise_as_input(flow).discretised(h_ns)
    assert driven.B is not None
    state = np.array(x, dtype=np.float64)
    drive = np.concatenate([np.array(u, dtype=np.float64).ravel(), NOISE_SHARE * flow.rates.rho * unit])
    B = driven.B
    if driven.a is not None:
        B, drive = np.hstack([B, driven.a.reshape(-1, 1)]), np.append(drive, 1.0)
    return plant_step.mapped(driven.A, state, B, drive, np.zeros((state.size, 0)), np.zeros(0), np.zeros(0))


@functools.lru_cache(maxsize=64)
def _noise_as_input(flow: ContinuousModel) -> ContinuousModel:
    """The model whose inputs are u and w; it has no noise."""
    rates = flow.rates
    N = np.eye(flow.state_count) if rates.noise_map is None else rates.noise_map
    B = N if rates.B is None else np.hstack([rates.B, N])
    return flow.replace(B=B, rho=np.zeros(rates.rho.size))


def measured(model: LSUModel, x: ArrayLike, u: ArrayLike, unit: Vector) -> Vector:
    """``y = C x + D u + d + r · unit`` (m,), wrapped into [−period/2, period/2) where an output has a period.

    Without D, d and period as :func:`measure`. Else ``|y − C x − D u − d| ≤ r`` holds exactly before the wrapping,
    which every filter's own rounding covers.
    """
    if model.has_plain_outputs:
        return measure(model.C, model.r, x, unit)
    m = model.output_count
    D = np.zeros((m, 0)) if model.D is None else model.D
    drive = np.zeros(0) if model.D is None else np.array(u, dtype=np.float64).ravel()
    if model.d is not None:
        D, drive = np.hstack([D, model.d.reshape(m, 1)]), np.append(drive, 1.0)
    out = plant_step.bounded(model.C, np.array(x, dtype=np.float64), D, drive, unit, model.r)
    if model.period is not None:
        turns = np.floor(np.divide(out, model.period, out=np.zeros(m), where=model.period > 0) + 0.5)
        out = out - turns * model.period
    return out


def measure(C: ArrayLike, r: ArrayLike, x: ArrayLike, unit: Vector) -> Vector:
    """``y = C x + r · unit`` (m,), the noise shrunk so that ``|y − C x| ≤ r`` holds exactly; C (m, n), r (m,)."""
    rows, state = np.array(C, dtype=np.float64), np.array(x, dtype=np.float64)
    widths = np.array(r, dtype=np.float64)
    return plant_step.bounded(rows, state, np.zeros((rows.shape[0], 0)), np.zeros(0), unit, widths)


@overload
def simulate(
    model: LSUModel,
    steps: int,
    seed: int,
    x1: ArrayLike | None = None,
    inputs: str | ArrayLike = "normal",
    noise: Noise = "uniform",
) -> Simulation: ...


@overload
def simulate(
    model: ContinuousModel,
    steps: int,
    seed: int,
    x1: ArrayLike | None = None,
    inputs: str | ArrayLike = "normal",
    noise: Noise = "uniform",
    *,
    dt_ns: int,
) -> ContinuousSimulation: ...


def simulate(
    model: LSUModel | ContinuousModel,
    steps: int,
    seed: int,
    x1: ArrayLike | None = None,
    inputs: str | ArrayLike = "normal",
    noise: Noise = "uniform",
    *,
    dt_ns: int | None = None,
) -> Simulation:
    """Simulate ``steps`` steps from x1 (n,), 0 by default; of a continuous model steps of ``dt_ns`` nanoseconds.

    ``inputs``: see :func:`input_at`, or an array (steps, p). ``noise``: ``"uniform"``, or ``"corners"`` for the
    extreme values only. The stored numbers fulfil the declared bounds in exact arithmetic (see :func:`next_state` and
    :func:`flow_state` for the exceptions).
    """
    flow = model if isinstance(model, ContinuousModel) else None
    if (flow is None) != (dt_ns is None):
        raise ModelError("dt_ns, the length of a step, belongs to a continuous model, and to no other")
    rates = model.rates if isinstance(model, ContinuousModel) else model
    n, m, p, q = rates.state_count, rates.output_count, rates.input_count, rates.rho.size
    X, Y = np.empty((steps, n)), np.empty((steps, m))
    U = _inputs(inputs, seed, steps, p)
    x = np.zeros(n) if x1 is None else np.array(x1, dtype=np.float64)
    if x.shape != (n,):
        raise ModelError(f"x1 must have {n} entries, one per state, it has shape {x.shape}")
    units = np.empty((steps, q))
    for k in range(steps):
        step = k + 1
        X[k] = x
        Y[k] = measured(rates, x, U[k], unit_noise(noise, seed, "output", step=step, size=m))
        units[k] = unit_noise(noise, seed, "process", step=step, size=q)
        x = (
            next_state(rates, x, U[k], units[k])
            if flow is None
            else flow_state(flow, x, U[k], unit=units[k], h_ns=dt_ns or 0)
        )
    if flow is None:
        return Simulation(X, Y, U)
    run = ContinuousSimulation(X, Y, U)
    run.flow, run.dt_ns, run.units = flow, dt_ns or 0, units
    return run


def _inputs(inputs: str | ArrayLike, seed: int, steps: int, p: int) -> Matrix:
    if isinstance(inputs, str):
        rows = [input_at(inputs, seed, k + 1, p) for k in range(steps)]
        return np.array(rows).reshape(steps, p)
    given = np.array(inputs, dtype=np.float64)
    if given.shape != (steps, p):
        raise ModelError(f"inputs must have shape {(steps, p)}, it has shape {given.shape}")
    return given
