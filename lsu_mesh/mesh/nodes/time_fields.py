"""How a source writes down when it measured."""

from __future__ import annotations

from typing import TypedDict

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.data_files.spans import seconds_text
from lsu_mesh.mesh.grid import Grid


class TimeFields(TypedDict):
    """Those fields of :class:`lsu_mesh.mesh.messages.Measurement`."""

    time_ns: int
    time_error_ns: int | None


def time_fields(grid: Grid, time_ns: int, error_ns: int) -> TimeFields:
    """Measured at ``time_ns ± error_ns``.

    A message cannot say a time before 1970. A datum of such a grid says nothing of its time, and is of its step's, as
    of an older peer; raises ``ModelError`` where that is not so.
    """
    if time_ns >= 0:
        return TimeFields(time_ns=time_ns, time_error_ns=error_ns)
    if error_ns == 0 and grid.time_of(grid.step_of(time_ns)) == time_ns:
        return TimeFields(time_ns=0, time_error_ns=None)
    raise ModelError(
        f"a measurement at {seconds_text(time_ns)} s ± {error_ns} ns is before 1970 and off the grid, and no message "
        "can say so: add a constant to all times, and to start_time"
    )
