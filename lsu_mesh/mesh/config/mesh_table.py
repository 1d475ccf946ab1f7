"""``[mesh]``: name, grid, length, seed and pace."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config.expected import Expected, Unfit, is_number
from lsu_mesh.mesh.config.problem import Problems
from lsu_mesh.mesh.config.settings import MeshSettings
from lsu_mesh.mesh.config.table import REQUIRED, Table
from lsu_mesh.mesh.data_files.moments import exact_dt, start_time_ns
from lsu_mesh.mesh.grid import Grid
from lsu_mesh.mesh.keys import NAME_RULE, is_name


def read_mesh(root: Table) -> MeshSettings:
    """The table; its grid is checked by :func:`grid_of_table`."""
    table = root.table("mesh", required=True) or Table({"name": "mesh", "dt": 1.0}, "mesh", root.problems)
    name = table.text("name")
    if isinstance(name, str) and not is_name(name):
        table.wrong("name", f'"{name}" is no name; expected {NAME_RULE}', NAME_RULE)
    exact: Any = table.read("dt", REQUIRED, DT)
    dt = float(exact) if isinstance(exact, Fraction) else exact
    if isinstance(dt, float) and (dt == 0.0 or not math.isfinite(1.0 / dt)):
        table.mismatch("dt", "a number whose inverse, the steps per second, is finite", f"{dt:g}")
    steps = table.whole("steps", None, low=1)
    seed = table.whole("seed", 1)
    rate = table.number("rate", 1.0 / dt if isinstance(dt, float) and dt else 1.0, above=0.0)
    start_ns: int | None = table.read("start_time", NO_START, START_TIME)
    future_ns, past_ns = table.span_ns("future", MeshSettings.future_ns), table.span_ns("past", MeshSettings.past_ns)
    start_time = None if start_ns is None else float(Fraction(start_ns, 10**9))
    table.finish()
    return MeshSettings(
        name=name, dt=dt, steps=steps, seed=seed, rate=rate, start_time=start_time,
        exact_dt=exact if isinstance(exact, Fraction) else None, start_ns=start_ns,
        starts_now=table.values.get("start_time") == NOW, future_ns=future_ns, past_ns=past_ns,
    )  # fmt: skip


def grid_of_table(mesh: MeshSettings, problems: Problems) -> Grid | None:
    """The grid; ``None`` after a mistake, which is noted, in ``dt`` or ``start_time``."""
    if mesh.exact_dt is None or problems.are_in("mesh", "dt", "start_time"):
        return None
    try:
        return Grid(mesh.start_ns or 0, mesh.exact_dt)
    except ModelError as error:
        problems.add("mesh", "dt", str(error), expected="a step that can be counted in nanoseconds")
        return None


def _as_dt(value: object) -> Fraction:
    if isinstance(value, int | float) and not is_number(value):
        raise Unfit
    try:
        return exact_dt(value)
    except ModelError:
        raise Unfit from None


def _as_moment(value: object) -> int | None:
    if value == NOW:
        return None
    try:
        return start_time_ns(value)[0]
    except ModelError as error:
        text = str(error)
        raise Unfit("" if text.startswith("expected") else text) from None


NOW = "now"
NO_START: int | None = None
DT = Expected('a number > 0, or a fraction such as "1/30"', _as_dt)
START_TIME = Expected[int | None]('seconds, a moment such as 2024-05-01T12:00:00Z, or "now"', _as_moment)
