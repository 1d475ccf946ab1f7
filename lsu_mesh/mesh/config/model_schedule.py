"""``[[model.schedule]]``: matrices and bounds that are others from a step, or a moment, on."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from typing import Any

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config.expected import WHOLE_LIMIT, Expected, Unfit
from lsu_mesh.mesh.config.model_errors import add_model_error
from lsu_mesh.mesh.config.settings import ScheduledModel
from lsu_mesh.mesh.config.table import REQUIRED, Table
from lsu_mesh.mesh.data_files.moments import start_time_ns
from lsu_mesh.mesh.data_files.spans import duration_text, moment_text
from lsu_mesh.mesh.grid import Grid
from lsu_mesh.model import ContinuousModel, LSUModel

KEYS = {"A": "A", "B": "B", "offset": "a", "noise_map": "noise_map", "rho": "rho"}
"""Keys of an entry, and the arguments of a model that they are."""
FIRST = 2
"""The model of ``[model]`` drives step 1 to 2 at least."""


def note_keys(model: Table) -> None:
    """Note that the schema has the keys of an entry, also where there is none."""
    model.problems.asked |= {f"{model.path}.schedule[0].{key}" for key in ("from", *KEYS)}


def read_schedule(
    tables: Sequence[Table], model: LSUModel | ContinuousModel, grid: Grid | None
) -> tuple[ScheduledModel, ...]:
    """The entries in order; what one does not say is as in the one before. All mistakes are noted."""
    found: list[ScheduledModel] = []
    for table in tables:
        first = table.read("from", REQUIRED, _start(grid))
        changes = _changes(table)
        table.finish()
        later = _changed(table, model, changes)
        if later is None or not isinstance(first, int):
            continue
        if found and first <= found[-1].first:
            text = f"is step {first}, not after step {found[-1].first} of the entry before"
            table.wrong("from", text, "a step after that of the entry before")
            continue
        model = later
        found.append(ScheduledModel(first, later))
    return tuple(found)


def _start(grid: Grid | None) -> Expected[int]:
    def convert(value: Any) -> int:
        if isinstance(value, bool):
            raise Unfit
        step = value if isinstance(value, int) else _step_at(value, grid)
        if step < FIRST:
            raise Unfit(f"it is step {step}, and [model] itself is in force from step 1 on")
        if step > WHOLE_LIMIT:
            raise Unfit
        return step

    words = "a step ≥ 2, or a moment on the grid after step 1 (text, date, or seconds with a point)"
    return Expected(words, convert)


def _step_at(value: object, grid: Grid | None) -> int:
    """The step whose t_k a moment is."""
    if not isinstance(value, str | float | date):
        raise Unfit
    try:
        moment = start_time_ns(value)[0]
    except ModelError:
        raise Unfit from None
    if grid is None:
        return FIRST  # the mistake is that of [mesh]
    step = grid.step_of(moment)
    late = grid.time_of(step) - moment
    if late:
        raise Unfit(
            text=f"is {duration_text(late)} before step {step} at {moment_text(grid.time_of(step))}; a model changes "
            f"at a step: take that moment, or from = {step}, or a dt that has a step there"
        )
    return step


def _changes(table: Table) -> dict[str, Any]:
    """The arguments that the entry gives; a mistake is noted and left out."""
    changes: dict[str, Any] = {}
    for key, argument in KEYS.items():
        if key in ("A", "B", "noise_map"):
            value = table.matrix(key, None)
        else:
            value = table.number_or_vector(key, None) if key == "rho" else table.vector(key, None)
        if value is not None:
            changes[argument] = value
    if not any(key in table.values for key in KEYS):
        table.wrong("", f"changes nothing; give one of {', '.join(KEYS)}", f"one of {', '.join(KEYS)}")
    return changes


def _changed(
    table: Table, model: LSUModel | ContinuousModel, changes: dict[str, Any]
) -> LSUModel | ContinuousModel | None:
    rates = model.rates if isinstance(model, ContinuousModel) else model
    shapes = {"A": (rates.state_count,) * 2, "B": (rates.state_count, rates.input_count)}
    for key, (rows, columns) in shapes.items():
        matrix = changes.get(key)
        if matrix is not None and (len(matrix), len(matrix[0])) != (rows, columns):
            table.mismatch(key, f"{rows} rows of {columns}, as in [model]", f"{len(matrix)} rows of {len(matrix[0])}")
            return None
    try:
        return model.replace(**changes, **({"inputs": rates.inputs} if "B" in changes else {}))
    except ModelError as error:
        for problem in error.problems:
            add_model_error(table, problem)
        return None
