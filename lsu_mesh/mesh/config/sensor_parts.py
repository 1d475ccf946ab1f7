"""Parts of ``[sensors.NAME]``: feedthrough, offsets and periods of its outputs, and what is known of its times."""

from __future__ import annotations

from typing import Any, TypedDict

from lsu_mesh.filters.grid import OffGrid
from lsu_mesh.mesh.config.expected import shown
from lsu_mesh.mesh.config.system import System
from lsu_mesh.mesh.config.table import Table
from lsu_mesh.model import LSUModel

_SIMULATED = ("every", "jitter", "clock_error")


class FurtherOutputs(TypedDict):
    """Those fields of ``SensorSettings``; empty where all is 0."""

    D: tuple[tuple[float, ...], ...]
    offset: tuple[float, ...]
    period: tuple[float, ...]


class Timing(TypedDict):
    """Those fields of ``SensorSettings``."""

    time_error_ns: int
    rate: tuple[float, ...]
    off_grid: OffGrid
    tolerance_ns: int | None
    every_ns: int | None
    jitter_ns: int
    clock_error_ns: int


def read_further_outputs(table: Table, count: int | None, model: LSUModel | None) -> FurtherOutputs:
    """``D``, ``offset`` and ``period``; ``count`` is that of the rows of C, ``None`` where they could not be read."""
    D = _feedthrough(table, count, model)
    offset = _per_row(table, "offset", count)
    period = _per_row(table, "period", count, "periods ≥ 0 (0: none)")
    return FurtherOutputs(
        D=tuple(map(tuple, D)) if any(map(any, D)) else (),
        offset=offset if any(offset) else (),
        period=period if any(period) else (),
    )


def _feedthrough(table: Table, count: int | None, model: LSUModel | None) -> list[list[float]]:
    D = table.matrix("D", None)
    if D is None:
        return []
    columns = None if model is None else model.input_count
    if columns == 0:
        table.without("D", "has no effect: the model has no inputs", "give [model] B, or remove it")
        return []
    if (count is not None and len(D) != count) or (columns is not None and len(D[0]) != columns):
        expected = f"{'as many' if count is None else count} rows, one per row of C"
        expected += "" if columns is None else f", and {columns} columns, one per input"
        table.mismatch("D", expected, f"{len(D)} rows of {len(D[0])}")
        return []
    found: list[list[float]] = D
    return found


def _per_row(table: Table, key: str, count: int | None, positive: str = "") -> tuple[float, ...]:
    """Numbers, one per row of C; not negative where ``positive`` says what they are."""
    values = table.vector(key, None)
    if values is None:
        return ()
    if count is not None and len(values) != count:
        table.mismatch(key, f"{count} numbers, one per row of C", len(values))
        return ()
    if positive and min(values, default=0.0) < 0:
        table.mismatch(key, positive, shown(values))
        return ()
    return tuple(values)


def read_timing(table: Table, count: int | None, system: System, *, is_simulated: bool) -> Timing:
    """What is known of the times, what a discrete model does with data off the grid, and what is simulated of them."""
    timing = Timing(
        time_error_ns=table.span_ns("time_error"),
        rate=_per_row(table, "rate", count, "bounds ≥ 0 of |dy/dt|, per second"),
        off_grid=table.choice("off_grid", ("refuse", "nearest"), "refuse"),
        tolerance_ns=table.span_ns("grid_tolerance", None),
        every_ns=table.span_ns("every", None, low=1),
        jitter_ns=table.span_ns("jitter"),
        clock_error_ns=table.span_ns("clock_error"),
    )
    if not is_simulated:
        for key in _SIMULATED:
            if key in table.values:
                table.without(key, "is simulated, and this sensor is not", "remove the key")
    if system.is_continuous:
        _refuse_discrete(table, timing)
    else:
        _check_discrete(table, timing, system)
    return timing


def _refuse_discrete(table: Table, timing: Timing) -> None:
    given = {"rate": timing["rate"], "off_grid": timing["off_grid"] != "refuse",
             "grid_tolerance": timing["tolerance_ns"] is not None}  # fmt: skip
    for key, is_given in given.items():
        if is_given:
            text = "has no effect with a continuous model, which takes every datum at its own moment"
            table.without(key, text, "remove it")


def _check_discrete(table: Table, timing: Timing, system: System) -> None:
    """Times that can never be on the grid are a mistake, unless the sensor says what is to become of them."""
    if timing["rate"] and timing["off_grid"] == "nearest":
        table.without("off_grid", "has no effect beside rate, which keeps the guarantee", "remove one of the two")
    if timing["rate"] or timing["off_grid"] == "nearest":
        return
    off_grid: dict[str, Any] = {key: timing[f"{key}_ns"] for key in ("time_error", "jitter", "clock_error")}  # type: ignore[literal-required]
    every, grid = timing["every_ns"], system.grid
    if every is not None and grid is not None:
        off_grid["every"] = grid.distance(grid.start_ns + every) > (timing["tolerance_ns"] or 0)
    for key, is_off in off_grid.items():
        if is_off:
            text = "puts its measurements off the grid, and a discrete model knows nothing between steps"
            remedy = 'set [model] continuous = true, or rate (the bound of |dy/dt|), or off_grid = "nearest"'
            table.without(key, text, f"{remedy} (no set is guaranteed then)")
