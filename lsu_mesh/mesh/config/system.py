"""``[model]``: matrices, noise bounds, domain, prior, names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config.model_errors import add_model_error
from lsu_mesh.mesh.config.problem import Problems
from lsu_mesh.mesh.config.table import Table
from lsu_mesh.model import LSUModel
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


def read_model(table: Table | None, problems: Problems) -> System:
    """The table ``[model]``; notes all its mistakes."""
    if table is None:
        return System()
    before = len(problems.records)
    A, B, rho = table.matrix("A"), table.matrix("B", None), _widths(table)
    noise_map = table.matrix("noise_map", None)
    names = {key: table.texts(key, None) for key in ("states", "inputs", "units")}
    is_read = len(problems.records) == before
    domain = read_box(table.table("domain"), problems)
    input_box = read_box(table.table("input_box"), problems)
    prior = read_box(table.table("prior", required=True), problems)
    table.finish()
    if not isinstance(A, list):
        return System(prior=prior, input_box=input_box)
    count = len(A)
    _check_box("prior", prior, count, of="state", problems=problems)
    if isinstance(B, list) or "B" not in table.values:
        _check_box("input_box", input_box, len(B[0]) if isinstance(B, list) else 0, of="input", problems=problems)
    if not is_read:
        return System(None, prior, input_box, count)
    try:
        return System(
            LSUModel(A=A, B=B, C=[], rho=rho, r=[], noise_map=noise_map, domain=domain, **names),
            prior,
            input_box,
            count,
        )
    except ModelError as error:
        for problem in error.problems:
            add_model_error(table, problem)
        return System(None, prior, input_box, count)


def _check_box(key: str, box: Orthotope | None, count: int, of: str, problems: Problems) -> None:
    if box is not None and box.dim != count:
        expected = f"{count} coordinates, one per {of}"
        problems.add(f"model.{key}", "", f"expected {expected}, found {box.dim}", expected=expected, found=str(box.dim))


def _widths(table: Table) -> Any:
    if isinstance(table.values.get("rho"), int | float):
        return table.number("rho")
    return table.vector("rho")


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
