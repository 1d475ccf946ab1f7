"""``[model]``: matrices, noise bounds, domain, prior, names, and the models that come later."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config.model_errors import add_model_error
from lsu_mesh.mesh.config.model_schedule import note_keys, read_schedule
from lsu_mesh.mesh.config.problem import Problems
from lsu_mesh.mesh.config.settings import ScheduledModel
from lsu_mesh.mesh.config.table import Table
from lsu_mesh.mesh.grid import Grid
from lsu_mesh.model import ContinuousModel, LSUModel
from lsu_mesh.supports.orthotope import Orthotope


@dataclass(frozen=True)
class System:
    """What ``[model]`` says, as far as it could be read.

    ``model`` is without outputs, ``prior`` holds x_1, ``input_box`` holds inputs that are unknown; each is ``None``
    where it is missing or wrong. ``state_count`` is that of A, so that other tables can be checked all the same.
    """

    model: LSUModel | None = None
    prior: Orthotope | None = None
    input_box: Orthotope | None = None
    state_count: int | None = None
    continuous: ContinuousModel | None = None
    """Of ``continuous = true``; ``model`` then is its first step."""
    schedule: tuple[ScheduledModel, ...] = ()
    input_delay_ns: int = 0
    is_continuous: bool = False
    """What the file says, also where the model could not be made."""
    grid: Grid | None = None
    instances: Table | None = None
    """``[model.instances]``, which is read once the banks are known."""


def read_model(table: Table | None, problems: Problems, grid: Grid | None) -> System:
    """The table ``[model]``; notes all its mistakes. ``grid`` is ``None`` where ``[mesh]`` has none."""
    if table is None:
        return System(grid=grid)
    before = len(problems.records)
    A, B, rho = table.matrix("A"), table.matrix("B", None), table.number_or_vector("rho")
    noise_map, offset = table.matrix("noise_map", None), table.vector("offset", None)
    names = {key: table.texts(key, None) for key in ("states", "inputs", "units")}
    is_read = len(problems.records) == before
    is_continuous = table.flag("continuous", False)
    delay = table.span_ns("input_delay")
    entries = table.tables("schedule")
    note_keys(table)
    domain = read_box(table.table("domain"), problems)
    input_box = read_box(table.table("input_box"), problems)
    prior = read_box(table.table("prior", required=True), problems)
    instances = table.table("instances")
    table.finish()
    if delay and not is_continuous:
        remedy = "remove it, or set continuous = true"
        table.without("input_delay", "has no effect: the inputs of a discrete model act for a whole step", remedy)
    known: dict[str, Any] = {"prior": prior, "input_box": input_box, "is_continuous": is_continuous, "grid": grid}
    known["instances"] = instances
    if not isinstance(A, list):
        return System(**known)
    known["state_count"] = count = len(A)
    _check_box("prior", prior, count, of="state", problems=problems)
    if isinstance(B, list) or "B" not in table.values:
        _check_box("input_box", input_box, len(B[0]) if isinstance(B, list) else 0, of="input", problems=problems)
    if not is_read:
        return System(**known)
    try:
        rates = LSUModel(A=A, B=B, C=[], rho=rho, r=[], noise_map=noise_map, domain=domain, a=offset, **names)
    except ModelError as error:
        for problem in error.problems:
            add_model_error(table, problem)
        return System(**known)
    model: LSUModel | ContinuousModel = ContinuousModel(rates) if is_continuous else rates
    schedule = read_schedule(entries, model, grid)
    first = _first_step(table, model, schedule, grid)
    continuous = model if isinstance(model, ContinuousModel) else None
    return System(**known, model=first, continuous=continuous, schedule=schedule, input_delay_ns=delay)


def _first_step(
    table: Table, model: LSUModel | ContinuousModel, schedule: tuple[ScheduledModel, ...], grid: Grid | None
) -> LSUModel | None:
    """The model of step 1 to 2; a continuous one must have steps of the length dt."""
    if isinstance(model, LSUModel):
        return model
    if grid is None:
        return None
    length = grid.time_of(2) - grid.time_of(1)
    try:
        for entry in schedule:
            if isinstance(entry.model, ContinuousModel):
                entry.model.discretised(length)
        return model.discretised(length)
    except ModelError as error:
        table.wrong("continuous", str(error), "a model whose exponential over one dt is finite")
        return None


def _check_box(key: str, box: Orthotope | None, count: int, of: str, problems: Problems) -> None:
    if box is not None and box.dim != count:
        expected = f"{count} coordinates, one per {of}"
        problems.add(f"model.{key}", "", f"expected {expected}, found {box.dim}", expected=expected, found=str(box.dim))


def read_box(table: Table | None, problems: Problems) -> Orthotope | None:
    """A table with ``lower`` and ``upper``."""
    if table is None:
        return None
    lower, upper = table.vector("lower"), table.vector("upper")
    table.finish()
    if not isinstance(lower, list) or not isinstance(upper, list):
        return None
    try:
        return Orthotope(lower, upper)
    except ModelError as error:
        add_model_error(table, str(error))
        return None
