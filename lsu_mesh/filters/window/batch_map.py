"""Maximum a posteriori estimation from a whole record at once, by one linear program, or a few with unknown entries."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.window.program import HalfWidths, Selected, WindowData, WindowProgram, WindowSolution
from lsu_mesh.filters.window.structure import Structure
from lsu_mesh.supports.orthotope import Orthotope

SETTLED = 1e-6
"""Passes end when no unknown entry moves by more than this share of its range."""
SHORTEST_STEP = 1.0 / 64.0


class Record(NamedTuple):
    """Outputs Y (T, m), NaN where missing, and inputs U (T − 1, p), row k from step k + 1 to the next."""

    Y: Matrix
    U: Matrix


def record(structure: Structure, Y: ArrayLike, U: ArrayLike | None) -> Record:
    """Y (T, m) and U (T or T − 1, p), checked.

    Raises ``ModelError`` that says which shape was expected.
    """
    m, p = structure.model.output_count, structure.model.input_count
    outputs = np.array(Y, dtype=np.float64)
    outputs = outputs.reshape(-1, 1) if outputs.ndim == 1 and m == 1 else outputs
    if outputs.ndim != 2 or outputs.shape[1] != m or len(outputs) < 2 or np.isinf(outputs).any():
        raise ModelError(
            f"Y must have shape (steps, {m}) with 2 steps at least, finite or NaN; it has shape {outputs.shape}"
        )
    if U is None and p:
        raise ModelError(f"the model has {p} input(s): give U of shape ({len(outputs)}, {p})")
    inputs = np.zeros((len(outputs), 0)) if U is None else np.array(U, dtype=np.float64)
    inputs = inputs.reshape(-1, 1) if inputs.ndim == 1 and p == 1 else inputs
    if inputs.ndim != 2 or inputs.shape[1] != p or len(inputs) not in (len(outputs), len(outputs) - 1):
        raise ModelError(f"U must have shape ({len(outputs)}, {p}), it has shape {inputs.shape}")
    inputs = inputs[: len(outputs) - 1]
    if not np.isfinite(inputs).all():
        raise ModelError("U must hold finite numbers only")
    return Record(outputs, inputs)


def batch_map(
    structure: Structure,
    data: Record,
    widths: HalfWidths,
    first: Orthotope | None = None,
    passes: int = 30,
    point: Selected = "centre",
) -> WindowSolution:
    """States, unknown entries and half-widths that make a whole record most probable.

    Without unknown entries one program gives the optimum. With some, each pass solves the program that is linear at the
    latest estimates and goes towards its answer as far as the *true* objective becomes smaller: the half-widths are
    those that the data need with the entries of the answer.

    Parameters
    ----------
    structure:
        Model with unknown entries; states stay in ``model.domain`` where there is one.
    data:
        See :func:`record`.
    widths:
        Which half-widths there are and what they cost.
    first:
        Box of x_1.
    passes:
        At most so many linearisations.

    Source: Pavelková & Kárný 2006; 2014, eqs (21)–(26).
    """
    program = WindowProgram(structure, widths)
    window = _window(structure, data, first)
    if not structure.has_unknown:
        return program.solve(window, point)
    best = _at(structure.start, structure, data, widths=widths, first=first, point=point)
    for _ in range(passes):
        theta = best.theta
        target = program.solve(window._replace(X=best.X, theta=theta), point)
        step, improved = 1.0, None
        while step >= SHORTEST_STEP and improved is None:
            answer = _at(
                theta + step * (target.theta - theta), structure, data, widths=widths, first=first, point=point
            )
            improved = answer if answer.objective < best.objective else None
            step *= 0.5
        if improved is None:
            break
        best = improved
        if np.max(np.abs(best.theta - theta) / np.maximum(structure.upper - structure.lower, 1e-300)) <= SETTLED:
            break
    return best


def _at(
    theta: Vector, structure: Structure, data: Record, widths: HalfWidths, first: Orthotope | None, point: Selected
) -> WindowSolution:
    """The program with the entries at theta, without linearisation."""
    settled = structure.settled(theta)
    answer = WindowProgram(settled, widths).solve(_window(settled, data, first), point)
    return answer._replace(theta=theta)


def _window(structure: Structure, data: Record, first: Orthotope | None) -> WindowData:
    N, n = len(data.Y), structure.model.state_count
    lower, upper = np.full((N, n), -np.inf), np.full((N, n), np.inf)
    for box, rows in ((structure.model.domain, slice(None)), (first, slice(1))):
        if box is not None:
            lower[rows], upper[rows] = np.maximum(lower[rows], box.lower), np.minimum(upper[rows], box.upper)
    A, B = structure.known["A"], structure.known["B"]
    return WindowData(
        Y=data.Y, U=data.U, spread=np.zeros_like(data.U), A=np.broadcast_to(A, (N - 1, *A.shape)),
        B=np.broadcast_to(B, (N - 1, *B.shape)), lower=lower, upper=upper, X=np.clip(np.zeros((N, n)), lower, upper),
        theta=structure.start, is_uniform=True,
    )  # fmt: skip
