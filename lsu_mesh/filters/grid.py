"""Data and discrete models: nothing is known between steps, so that a datum off the grid is refused or widened."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.held_inputs import HeldInputs, Input
from lsu_mesh.filters.validation import half_width_vector, input_interval
from lsu_mesh.model import LSUModel

OffGrid = Literal["refuse", "nearest"]


def step_of(time_ns: int, start_ns: int, dt_ns: int) -> int:
    """The step k with ``t_{k−1} < t ≤ t_k``, ``t_k = start + k dt``, all in ns."""
    return -((start_ns - time_ns) // dt_ns)


def grid_half_widths(
    outputs: LSUModel,
    r: ArrayLike | None,
    time_ns: int,
    error_ns: int,
    step_ns: int,
    *,
    tolerance_ns: int = 0,
    rate: ArrayLike | None = None,
    off_grid: OffGrid = "refuse",
    inputs: tuple[Input, Input] | None = None,
) -> Vector:
    """r (m,) with which a datum at ``time_ns ± error_ns`` may be used at the step of the time ``step_ns``.

    On the grid (within the tolerance, and with no error) it is r. Else ``r + rate (|t_k − t| + e)`` where a ``rate``
    (m,) is given, the bound of the noise-free output's |dy/dt| in units per second, with ``|D| |u_{k−1} − u_k|``
    besides; ``inputs`` are these two. ``off_grid="nearest"`` takes r as it is: no set is guaranteed then.

    Raises
    ------
    ModelError
        The datum is off the grid and neither is given.
    """
    widths = half_width_vector("r", r, np.array(outputs.r))
    distance = abs(step_ns - time_ns)
    if (distance <= tolerance_ns and error_ns == 0) or (rate is None and off_grid == "nearest"):
        return widths
    if rate is None:
        raise ModelError(
            f"off the grid: a datum at {time_ns} ns ± {error_ns} ns cannot be carried to the step at {step_ns} ns by a "
            "discrete model; give a continuous model, or rate= (the bound of |dy/dt|), or off_grid='nearest'"
        )
    rates = half_width_vector("rate", rate, np.zeros(outputs.output_count))
    seconds = np.nextafter((distance + error_ns) / 1e9, np.inf)
    jump = np.zeros(outputs.output_count)
    if outputs.D is not None:
        if inputs is None:
            raise ModelError("off the grid with D ≠ 0: give the inputs before and at the step")
        ends = [input_interval(u, outputs.input_count) for u in inputs]
        size = np.abs(ends[0][0] - ends[1][0]) + ends[0][1] + ends[1][1]
        jump = np.array([sum(abs(a) * b for a, b in zip(row, size, strict=True)) for row in outputs.D])
    total = widths + rates * seconds + jump
    return np.where(total > widths, total * (1.0 + (outputs.input_count + 8) * 2.0**-52), widths)


def check_times(times: object, rows: int) -> list[int]:
    """Times of the rows in ns as ``int``; ``datetime64`` is taken in ns since 1970.

    Raises ``ModelError`` where they are no whole numbers, not one per row, or decrease.
    """
    given = np.asarray(times)
    if given.dtype.kind == "M":
        if np.isnat(given).any():
            raise ModelError("times must not be NaT (not a time)")
        given = given.astype("datetime64[ns]").astype(np.int64)
    values: list[int] = given.tolist()
    if given.ndim != 1 or not all(isinstance(value, int) and not isinstance(value, bool) for value in values):
        raise ModelError(
            "times must be whole numbers of nanoseconds, or datetime64: seconds as floats have lost their last digits; "
            f"they are of type {given.dtype}"
        )
    if len(values) != rows:
        raise ModelError(f"times must have {rows} entries, one per row of Y, it has {len(values)}")
    for k in range(1, rows):
        if values[k] < values[k - 1]:
            raise ModelError(
                f"times must not decrease: row {k - 1} is at {values[k - 1]} ns, row {k} at {values[k]} ns"
            )
    return values


def held_rows(times: list[int], U: NDArray[np.float64]) -> HeldInputs:
    """Row k of U acts from the time of row k on, of rows at one time the last; the first acts before them, too."""
    if U.shape[1] == 0:
        return HeldInputs.constant()
    last = {time: k for k, time in enumerate(times)}
    return HeldInputs(tuple(last), tuple(U[k] for k in last.values()), before=U[0])
