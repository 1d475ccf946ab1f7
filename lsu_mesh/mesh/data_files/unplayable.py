"""The likely mistake behind a file of which no row can be played, or whose rows come in a strange rhythm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.mesh.data_files.data_file import DataFile
from lsu_mesh.mesh.data_files.decimal_times import EARLIEST_S
from lsu_mesh.mesh.data_files.spans import duration_text, moment_text, seconds_text
from lsu_mesh.mesh.grid import Grid

NS = 10**9
_FACTORS = ((10**3, "ms"), (10**6, "us"), (10**9, "ns"))
LONG_BEFORE = 1000
"""Steps without a row before the first one that are no surprise."""
_NEARLY = 0.2
"""A period within 20 % of 1000 dt looks like milliseconds."""


def has_other_epoch(data: DataFile, grid: Grid) -> bool:
    """Whether the times count from 1970 and start_time does not: thousands of millions of empty steps would come."""
    return data.time_ns is not None and int(data.time_ns[0]) >= EARLIEST_S * NS > abs(grid.start_ns)


def why_unplayable(data: DataFile, grid: Grid, last_step: int | None) -> str:
    """One line: why no row is inside the run, and what to write."""
    if data.time_ns is None:
        return _outside_steps(data, last_step)
    first, last = int(data.time_ns[0]), int(data.time_ns[-1])
    remedy = f"the first row would be step 1 with start_time = {proposed_start(first, grid)}"
    where = f"its rows are from {moment_text(first)} to {moment_text(last)}"
    if has_other_epoch(data, grid):
        return f"no row is played: its times count from 1970, start_time does not; {remedy}"
    if grid.start_ns >= EARLIEST_S * NS > abs(last):
        return f"no row is played: start_time counts from 1970, its times do not ({where}); {remedy}"
    if last < grid.time_of(1):
        return f"no row is played: start_time = {moment_text(grid.start_ns)} is after all rows; {where}; {remedy}"
    end = "" if last_step is None else f", after the last step {last_step} at {moment_text(grid.time_of(last_step))}"
    return f"no row is played: {where}{end}; {remedy}, or take more steps"


def _outside_steps(data: DataFile, last_step: int | None) -> str:
    assert data.steps is not None
    first, last = int(data.steps[0]), int(data.steps[-1])
    if last < 1:
        return f"no row is played: its steps are {first} to {last}, and the first step of a run is 1; count from 1"
    return f"no row is played: its steps are {first} to {last}, and the run ends at step {last_step}; take more steps"


def proposed_start(first_ns: int, grid: Grid) -> str:
    """The ``start_time`` that makes the first row step 1, as it is written in TOML."""
    start = first_ns - round(grid.dt * NS)
    if start >= EARLIEST_S * NS:
        return moment_text(start)
    text = seconds_text(start)
    return text if "." in text else f"{text}.0"


def off_grid_error(count: int, rows: int, largest_ns: int, sensor: str | None) -> str:
    """Rows between steps and a model that knows nothing there; ``sensor`` is None for a file of inputs."""
    said = (
        f"{count} of {rows} rows {'lies' if count == 1 else 'lie'} off the grid, by up to {duration_text(largest_ns)}"
    )
    text = f"{said}, and a discrete model knows nothing between steps; set [model] continuous = true"
    if sensor is None:
        return f"{text}, or take a dt and start_time that have a step at each row"
    here = f"[sensors.{sensor}]"
    return (
        f'{text}, or {here} rate = [the bound of |dy/dt|], or {here} off_grid = "nearest" (no set is guaranteed then)'
    )


def nearest_doubt(count: int, largest_ns: int) -> str:
    """Rows that count as measured at another moment than their own, as the sensor asks for."""
    said = f"{count} {'row lies' if count == 1 else 'rows lie'} off the grid, by up to {duration_text(largest_ns)}"
    return f'{said}, and off_grid = "nearest": every set will say guarantee = "none"'


def off_grid_doubt(distances_ns: NDArray[np.int64], nearest: bool) -> tuple[str, ...]:
    """Rows that are taken as measured at another moment than their own."""
    if not nearest or not len(distances_ns):
        return ()
    far = duration_text(int(distances_ns.max()))
    return (f"rows lie off the grid ({len(distances_ns)}, by up to {far}) and are taken as measured at their step",)


def late_doubt(data: DataFile, grid: Grid, first_step: int) -> tuple[str, ...]:
    """A first row far inside the run: start_time is probably not that of the file."""
    if data.time_ns is None or first_step <= max(LONG_BEFORE, 10 * data.row_count):
        return ()
    start = proposed_start(int(data.time_ns[0]), grid)
    return (f"the first row is step {first_step}; start_time = {start} makes it step 1",)


def period_doubt(data: DataFile, grid: Grid, gaps: NDArray[np.int64]) -> tuple[str, ...]:
    """Times in milliseconds that are read as seconds have a period of 1000 dt; so have the other units."""
    between = gaps[gaps > 0]
    if data.time_ns is None or not len(between):
        return ()
    period, dt = int(np.median(between)), float(grid.dt * NS)
    for factor, unit in _FACTORS:
        if abs(period / factor / dt - 1) <= _NEARLY:
            text = (
                f"the period {duration_text(period)} is {factor} times dt; are the times in {unit}? "
                f'Then say time_unit = "{unit}"'
            )
            return (text,)
    return ()
