"""A step with data between the grid's moments: from the posterior of the step before, in the order of their times.

Carry to each datum with ``t < t_k``, cut, carry to t_k; then what else speaks of x(t_k); then the data at t_k. A set is
met only with a set of the same moment. Where a strip is left out, all of the step is made anew without it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.timed_data import TimedDatum, bring, carry, half_widths_at
from lsu_mesh.mesh.estimation.inconsistency import DroppedStrip, widened
from lsu_mesh.mesh.estimation.step_data import Datum, StepData
from lsu_mesh.mesh.measurement_time import is_timed


@dataclass(frozen=True)
class Walk:
    """The way of one step's data into an engine's set, from a prediction of x(t_k) or from the posterior before it."""

    data: StepData
    prediction: object
    """Snapshot of the engine with the set of x(t_k) before any data of the step."""

    def go(self, engine: Filter, between: Callable[[], None], factor: float = 1.0) -> None:
        """All data, ``between`` after those before t_k; ``InconsistentData`` leaves the engine anywhere."""
        data, inside = self.data, [one.timed for one in self.data.inside]
        if inside and data.origin is not None and data.flow is not None:
            engine.restore(data.origin.set)
            wider = inside if factor == 1.0 else [_wider(one, factor) for one in inside]
            bring(engine, data.flow, wider, start_ns=data.start_ns, end_ns=data.end_ns, inputs=data.inputs)
        else:
            engine.restore(self.prediction)
        between()
        data.update(engine, factor)


def _wider(datum: TimedDatum, factor: float) -> TimedDatum:
    assert datum.r is not None
    return replace(datum, r=factor * datum.r)


def contradicting_strips(engine: Filter, walk: Walk) -> list[tuple[Datum, int, DroppedStrip]]:
    """The strips that miss, each alone, the posterior of the step before carried uncut to their moments.

    The engine stays as it is.
    """
    data, before = walk.data, engine.snapshot()
    found: list[tuple[Datum, int, DroppedStrip]] = []
    try:
        if data.inside and data.origin is not None and data.flow is not None:
            engine.restore(data.origin.set)
            now = data.start_ns
            for one in data.inside:
                carry(engine, data.flow, now, end_ns=one.timed.time_ns, inputs=data.inputs)
                now = one.timed.time_ns
                found += _missing(engine, data, one)
        engine.restore(walk.prediction)
        for one in data.at_end:
            found += _missing(engine, data, one)
    finally:
        engine.restore(before)
    return found


def _missing(engine: Filter, data: StepData, one: Datum) -> list[tuple[Datum, int, DroppedStrip]]:
    """The strips of one datum that miss the engine's set, a set of its moment."""
    return [
        (one, row, strip_of(engine, data, one, row=row, is_alone=True))
        for row in range(len(one.timed.y))
        if not np.isnan(one.timed.y[row]) and not _agrees(engine, data, one.timed, row)
    ]


def _agrees(engine: Filter, data: StepData, datum: TimedDatum, row: int) -> bool:
    y = np.full(len(datum.y), np.nan)
    y[row] = datum.y[row]
    before = engine.snapshot()
    try:
        data.cut(engine, replace(datum, y=y))
    except InconsistentData:
        return False
    engine.restore(before)
    return True


def strip_of(engine: Filter, data: StepData, one: Datum, *, row: int, is_alone: bool) -> DroppedStrip:
    """What is told of a strip, by the engine's set, a set of its moment."""
    datum, outputs = one.timed, one.timed.outputs
    assert outputs is not None
    r = datum.r
    u = data.u
    if data.flow is not None:
        r = half_widths_at(engine, data.flow, datum, data.inputs)
        u = data.inputs.hull(datum.time_ns - datum.error_ns, datum.time_ns + datum.error_ns)
    band = widened(engine.predict_output(u, outputs), r, outputs.r)
    return DroppedStrip(
        sensor=datum.sensor,
        output=outputs.outputs[row],
        y=float(datum.y[row]),
        lower=float(band.lower[row]),
        upper=float(band.upper[row]),
        is_alone=is_alone,
        time_ns=one.message.time_ns if is_timed(one.message) else None,
    )


def without(data: StepData, strips: Sequence[tuple[Datum, int, DroppedStrip]]) -> StepData:
    """The data without these strips."""
    gone: dict[int, list[int]] = {}
    for one, row, _ in strips:
        gone.setdefault(id(one), []).append(row)
    kept: list[Datum] = []
    for one in data.data:
        y = np.array(one.timed.y)
        y[gone.get(id(one), [])] = np.nan
        if not np.isnan(y).all():
            kept.append(Datum(one.message, replace(one.timed, y=y)))
    return replace(data, data=tuple(kept))


def remaining_strips(engine: Filter, data: StepData) -> list[DroppedStrip]:
    """Told of the strips of data that only together contradict the set; the engine holds the set of x(t_k)."""
    return [
        strip_of(engine, data, one, row=row, is_alone=False)
        for one in data.data
        for row in range(len(one.timed.y))
        if not np.isnan(one.timed.y[row])
    ]
