"""``[model]``: matrices, noise bounds, domain, prior, names."""

from __future__ import annotations

from typing import Any

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config.table import Problems, Table
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope


def read_model(table: Table | None, problems: Problems) -> tuple[LSUModel | None, Orthotope | None, Orthotope | None]:
    """The model without outputs, the prior of x_1 and the box of unknown inputs."""
    if table is None:
        return None, None, None
    before = len(problems.lines)
    A, B, rho = table.matrix("A"), table.matrix("B", None), _widths(table)
    noise_map = table.matrix("noise_map", None)
    domain = read_box(table.table("domain"), problems)
    input_box = read_box(table.table("input_box"), problems)
    prior = read_box(table.table("prior", required=True), problems)
    names = {key: table.texts(key, None) for key in ("states", "inputs", "units")}
    table.finish()
    if len(problems.lines) > before:
        return None, prior, input_box
    try:
        model = LSUModel(A, B, [], rho, [], noise_map, domain, **names)
    except ModelError as error:
        problems.add("[model]", str(error))
        return None, prior, input_box
    if prior is not None and prior.dim != model.state_count:
        problems.add("[model.prior]", f"expected {model.state_count} coordinates, one per state, found {prior.dim}")
    if input_box is not None and input_box.dim != model.input_count:
        problems.add(
            "[model.input_box]",
            f"expected {model.input_count} coordinates, one per input, found {input_box.dim}",
        )
    return model, prior, input_box


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
        problems.add(f"[{table.path}]", str(error))
        return None
