"""A few steps that count for nothing, so that a peer compiles and loads nothing when data come."""

from __future__ import annotations

import numpy as np

from lsu_mesh.filters.filter import Filter
from lsu_mesh.mesh.sets import to_message

REHEARSED_STEPS = 6
"""So many steps bring a limited complexity into play."""


def rehearse(engine: Filter) -> None:
    """Do everything that a node asks of its filter; the filter is left as it was."""
    before, model = engine.snapshot(), engine.model
    for _ in range(REHEARSED_STEPS):
        if model.output_count:
            engine.update(engine.predict_output().point)
        engine.condition(engine.support.interval_hull())
        to_message(engine.support)
        engine.bounds()
        engine.predict(np.zeros(model.input_count) if model.input_count else None)
    engine.restore(before)
