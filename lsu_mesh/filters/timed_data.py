"""Data at their own moments: the events of a step in order, on any filter and a continuous model.

The posterior of step k is the set of ``x(t_k)`` after all data in ``(t_{k−1}, t_k]``. From the posterior of k − 1
:func:`bring` carries the set to each datum with ``t < t_k``, cuts, and carries it to t_k; then comes whatever is a set
of ``x(t_k)``; then :func:`cut` with each datum at ``t = t_k``. A set is met only with a set of the same moment.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.held_inputs import HeldInputs, Piece
from lsu_mesh.filters.time_error import time_widening
from lsu_mesh.filters.validation import half_width_vector
from lsu_mesh.kernels.runtime.rounding import EPSILON
from lsu_mesh.model import ContinuousModel, LSUModel
from lsu_mesh.supports.orthotope import Orthotope


@dataclass(frozen=True, eq=False)
class TimedDatum:
    """Outputs y (m,), NaN where missing, of the moment ``time_ns``, which is known to ``error_ns``.

    outputs: a model whose outputs (C, D, d, period, r) y has, of one sensor say; ``None``: the filter's own. r (m,):
    half-widths of this datum; ``None``: the outputs'. sensor, row: where it comes from, for the order.
    """

    time_ns: int
    y: Vector
    error_ns: int = 0
    outputs: LSUModel | None = None
    r: Vector | None = None
    sensor: str = ""
    row: int = 0

    @property
    def order(self) -> tuple[int, str, int, bytes, int]:
        """(time, sensor, time error, y as bytes, row): no restart and no shuffle changes it."""
        return self.time_ns, self.sensor, self.error_ns, np.asarray(self.y, dtype="<f8").tobytes(), self.row


def ordered(data: Iterable[TimedDatum]) -> list[TimedDatum]:
    """The data in the order in which they are applied."""
    return sorted(data, key=lambda datum: datum.order)


def carry(filter: Filter, flow: ContinuousModel, start_ns: int, end_ns: int, inputs: HeldInputs) -> None:
    """Predict from one moment to a later one: one stretch of the model between two switches of the input.

    Raises ``InconsistentData`` where the prediction misses the domain; the filter is then where it was.
    """
    if end_ns < start_ns:
        raise ModelError(f"nothing is carried backwards: from {start_ns} ns to {end_ns} ns")
    before = filter.snapshot()
    try:
        for piece in inputs.pieces(start_ns, end_ns):
            _predict(filter, flow, piece)
    except InconsistentData:
        filter.restore(before)
        raise


def _predict(filter: Filter, flow: ContinuousModel, piece: Piece) -> None:
    """An input that varies within its box, nobody knows how, is one more noise."""
    if not (piece.varies and isinstance(piece.u, Orthotope)):
        filter.predict(piece.u, model=flow.discretised(piece.length_ns))
        return
    rates, (lower, upper) = flow.rates, piece.u.bounds()
    assert rates.B is not None
    middle = lower + 0.5 * (upper - lower)
    reach = np.nextafter(np.maximum(upper - middle, middle - lower), np.inf)
    N = np.eye(rates.state_count) if rates.noise_map is None else rates.noise_map
    noisier = flow.replace(noise_map=np.hstack([N, rates.B]), rho=np.append(rates.rho, reach))
    filter.predict(middle, model=noisier.discretised(piece.length_ns))


def half_widths_at(filter: Filter, flow: ContinuousModel, datum: TimedDatum, inputs: HeldInputs) -> Vector | None:
    """r (m,) of the datum with what the error of its time costs, from the filter's set of its nominal moment.

    ``None`` where the error is too long for the model: the datum cannot be used.
    """
    outputs = filter.model if datum.outputs is None else datum.outputs
    r = half_width_vector("r", datum.r, np.array(outputs.r))
    if datum.error_ns == 0:
        return r
    acting = inputs.hull(datum.time_ns - datum.error_ns, datum.time_ns + datum.error_ns)
    drift = time_widening(flow, outputs, *filter.bounds(), datum.error_ns, acting)
    return None if drift is None else np.where(drift > 0.0, (r + drift) * (1.0 + 2.0 * EPSILON), r)


def cut(filter: Filter, flow: ContinuousModel, datum: TimedDatum, inputs: HeldInputs) -> bool:
    """Data update of a filter whose set is one of ``x(datum.time_ns)``; ``False`` where the datum cannot be used.

    Raises ``InconsistentData`` as :meth:`Filter.update`; the filter is then where it was.
    """
    r = half_widths_at(filter, flow, datum, inputs)
    if r is None:
        return False
    acting = inputs.hull(datum.time_ns - datum.error_ns, datum.time_ns + datum.error_ns)
    filter.update(datum.y, r, model=datum.outputs, u=acting)
    return True


def bring(
    filter: Filter, flow: ContinuousModel, data: Sequence[TimedDatum], start_ns: int, end_ns: int, inputs: HeldInputs
) -> list[TimedDatum]:
    """From the set of x(start) carry to each datum, in order, cut, and carry to the end; returns what was not used.

    All data lie in ``start < t < end`` (those at the end come after what else speaks of x(end): use :func:`cut`).

    Raises
    ------
    InconsistentData
        The message names the datum; the filter is back at the start.
    """
    unused: list[TimedDatum] = []
    before, now = filter.snapshot(), start_ns
    for datum in ordered(data):
        if not start_ns < datum.time_ns < end_ns:
            raise ModelError(f"the datum at {datum.time_ns} ns does not lie between {start_ns} and {end_ns} ns")
        try:
            carry(filter, flow, now, end_ns=datum.time_ns, inputs=inputs)
            if not cut(filter, flow, datum, inputs):
                unused.append(datum)
        except InconsistentData as error:
            filter.restore(before)
            where = f"{datum.sensor or 'datum'} at {datum.time_ns} ns"
            raise InconsistentData(f"{where}: {error}", error.rows, error.gap) from error
        now = datum.time_ns
    try:
        carry(filter, flow, now, end_ns=end_ns, inputs=inputs)
    except InconsistentData:
        filter.restore(before)
        raise
    return unused


def contradicting(
    filter: Filter, flow: ContinuousModel, data: Sequence[TimedDatum], start_ns: int, inputs: HeldInputs
) -> list[tuple[TimedDatum, tuple[int, ...]]]:
    """The data with strips that miss, each judged alone, the set of x(start) carried uncut to their moments.

    Returns each such datum with its rows. The filter stays as it is.
    """
    found: list[tuple[TimedDatum, tuple[int, ...]]] = []
    before, now = filter.snapshot(), start_ns
    try:
        for datum in ordered(data):
            carry(filter, flow, now, end_ns=datum.time_ns, inputs=inputs)
            now = datum.time_ns
            carried = filter.snapshot()
            rows = tuple(i for i in range(len(datum.y)) if _misses(filter, flow, datum, row=i, inputs=inputs))
            filter.restore(carried)
            if rows:
                found.append((datum, rows))
    finally:
        filter.restore(before)
    return found


def _misses(filter: Filter, flow: ContinuousModel, datum: TimedDatum, row: int, inputs: HeldInputs) -> bool:
    """Whether one strip alone is proved to miss the set."""
    y = np.full(len(datum.y), np.nan)
    y[row] = datum.y[row]
    alone = TimedDatum(
        time_ns=datum.time_ns,
        y=y,
        error_ns=datum.error_ns,
        outputs=datum.outputs,
        r=datum.r,
        sensor=datum.sensor,
        row=datum.row,
    )
    before = filter.snapshot()
    try:
        cut(filter, flow, alone, inputs)
    except InconsistentData:
        return True
    filter.restore(before)
    return False
