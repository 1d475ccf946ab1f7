"""Time updates of a mesh, from t_k to t_{k+1}: by its one model, by that of the step, or by its continuous model."""

from __future__ import annotations

from dataclasses import dataclass

from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.held_inputs import HeldInputs
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.filters.timed_data import carry
from lsu_mesh.mesh.config.settings import Configuration


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

    ``since``: the moment in ns at which u begins to act, if it is known; ``earlier`` acts till then. A discrete model
    is driven by one input for a whole step: by one of the box of both, where u begins within it.

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
        engine.predict(
            held.hull(start, end), model=None if configuration.has_one_model else configuration.stretch_model(k)
        )
    else:
        carry(engine, flow, start, end_ns=end, inputs=held)
