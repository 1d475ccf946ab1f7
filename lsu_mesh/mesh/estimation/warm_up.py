"""A few steps that count for nothing, so that a peer compiles and loads nothing when data come."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from lsu_mesh.errors import InconsistentData, UnboundedSupport
from lsu_mesh.filters.filter import Filter
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.open_loop import OpenLoop
from lsu_mesh.mesh.estimation.time_update import predict_step
from lsu_mesh.mesh.sets import to_message
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope

REHEARSED_STEPS = 6
"""So many steps bring a limited complexity into play."""


def warm_up(engine: Filter, configuration: Configuration) -> None:
    """Do everything that a node asks of its filter; the filter is left as it was."""
    input_box = configuration.input_box
    before, reach = engine.snapshot(), OpenLoop(configuration, engine.model)
    reach.begin(engine.support.interval_hull())
    with suppress(InconsistentData, UnboundedSupport):  # without the real inputs a state may leave its domain
        for number in range(REHEARSED_STEPS):
            _warm_up_step(engine, reach, configuration, input_box if number % 2 else None, starts=number % 3 == 2)
    engine.restore(before)


def _warm_up_step(
    engine: Filter, reach: OpenLoop, configuration: Configuration, input_box: Orthotope | None, *, starts: bool
) -> None:
    model = engine.model
    if model.output_count:
        if model.D is None:
            engine.update(engine.predict_output().point)
        else:
            seen = np.zeros(model.input_count)
            engine.update(engine.predict_output(seen).point, u=seen)
    hull = engine.support.interval_hull()
    around = Parallelotope(hull.center, np.diag(np.maximum(hull.half_widths, 1.0)))
    across = Parallelotope(hull.center, 0.5 * around.generators @ np.triu(np.ones_like(around.generators)))
    for other in (around, hull, engine.support, across):
        with suppress(InconsistentData):  # the centre of a hull need not be in the set
            engine.condition(other)
        if starts:
            engine.reset(other)
    to_message(engine.support)
    engine.bounds()
    u = None
    if model.input_count:
        u = np.zeros(model.input_count) if input_box is None else input_box
    predict_step(engine, configuration, 1, u)
    reach.predict(u, 1)
