"""Time updates of a mesh, from t_k to t_{k+1}: by its one model, by that of the step, or by its continuous model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.held_inputs import HeldInputs
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.filters.timed_data import carry
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope


@dataclass(frozen=True)
class Origin:
    """The posterior of the step before, from which the data between the two steps are reached."""

    set: object
    """Snapshot of the engine that holds it."""
    u: Drive
    """What drove the step before: the input, or the box of all inputs."""
    earlier: Drive = None
    """The input before that, where inputs may act late and it was known."""
    since: int | None = None
    """When ``u`` began to act, where its message says so."""


def predict_step(
    engine: Filter, configuration: Configuration, k: int, u: Drive, earlier: Drive = None, since: int | None = None
) -> None:
    """Time update of the set of x(t_k) with u, and with ``earlier``, the input before it, where u may act late.

    ``since``: the moment in ns at which u begins to act, if it is known; ``earlier`` acts till then. What a discrete
    model says of a step in which the input switches: :func:`switched_within`.

    Raises what :meth:`Filter.predict` does.
    """
    acts_late = u is not None and configuration.input_delay_ns > 0
    if not acts_late:
        engine.predict(u, model=None if configuration.has_one_model else configuration.stretch_model(k))
        return
    flow = configuration.flow(k)
    start, end = configuration.grid.time_of(k), configuration.grid.time_of(k + 1)
    before = configuration.input_box if earlier is None else earlier
    begins, delay = (start, configuration.input_delay_ns) if since is None else (since, 0)
    held = HeldInputs([begins], [u], before=before, delay_ns=delay)
    if flow is None:
        base = engine.model if configuration.has_one_model else configuration.stretch_model(k)
        u, model = switched_within(base, held.hull(start, end))
        engine.predict(u, model=model)
    else:
        carry(engine, flow, start, end_ns=end, inputs=held)


def switched_within(model: LSUModel, u: Drive) -> tuple[Drive, LSUModel]:
    """The input and the model of a step in which the input switches, of which only a box is known.

    An input that acts for a part of a step need not lead to ``B u`` of any one u: a double integrator that is pushed
    late gains speed and no way. Each state for itself gains between ``B_i u`` of the least and of the largest input, as
    long as the effect of an input on it has one sign. So ``|B|`` times the half-widths (n,) bounds one more noise.
    """
    if not isinstance(u, Orthotope) or model.B is None:
        return u, model
    lower, upper = u.bounds()
    middle: Vector = lower + 0.5 * (upper - lower)
    half = np.nextafter(np.maximum(upper - middle, middle - lower), np.inf)
    size, limits = np.abs(model.B), np.finfo(np.float64)
    spread = size @ half * (1.0 + 4.0 * (model.input_count + 1) * limits.eps)
    spread = np.where(size.any(axis=1), spread + model.input_count * limits.tiny, 0.0)  # products may underflow
    n = model.state_count
    noise_map = np.eye(n) if model.noise_map is None else model.noise_map
    wider = model.replace(noise_map=np.hstack([noise_map, np.eye(n)]), rho=np.concatenate([model.rho, spread]))
    return middle, wider
