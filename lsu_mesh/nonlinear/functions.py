"""Functions of a graph with their derivatives, as kernels take them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from lsu_mesh.errors import ModelError
from lsu_mesh.kernels.intervals import operations as op
from lsu_mesh.kernels.intervals.enclosure import FIRST, NOT_ENCLOSED, SECOND, Functions
from lsu_mesh.kernels.intervals.tape import Tape
from lsu_mesh.nonlinear.graph import Graph, Node, arguments

MAX_SECOND_ORDER = 20_000
"""With more operations than this in all second derivatives only the first order is taken."""


def compiled(graph: Graph, outputs: Sequence[int], variables: Sequence[int]) -> Functions:
    """Functions on one tape; ``variables`` are those that are not known, by their numbers."""
    m, p = len(outputs), len(variables)
    gradients = np.full((m, p), -1)
    hessians = np.full((m, p, p), -1)
    orders = np.full(m, NOT_ENCLOSED)
    slopes: dict[tuple[int, int], int] = {}
    for i, output in enumerate(outputs):
        orders[i] = FIRST
        for j in sorted(graph.variables_of(output) & set(variables)):
            slope = graph.derivative(output, j)
            if graph.value(slope) != 0.0:
                slopes[i, variables.index(j)] = slope
    curvatures: dict[tuple[int, int, int], int] = {}
    for i, output in enumerate(outputs):
        if graph.has_kink(output):
            continue
        own = {j: slope for (row, j), slope in slopes.items() if row == i}
        try:
            found = {
                (i, j, k): graph.derivative(slope, variables[k])
                for j, slope in own.items()
                for k in own
                if k >= j and variables[k] in graph.variables_of(slope)
            }
        except ModelError:  # too large: the first order alone
            continue
        curvatures |= {place: node for place, node in found.items() if graph.value(node) != 0.0}
        orders[i] = SECOND
    first = graph.below([*outputs, *slopes.values()])
    rest = [k for k in graph.below(curvatures.values()) if k not in set(first)]
    row_of = {node: row for row, node in enumerate([*first, *rest])}
    for place, node in slopes.items():
        gradients[place] = row_of[node]
    for at, node in curvatures.items():
        hessians[at] = row_of[node]
    return Functions(
        tape=_tape([graph.nodes[k] for k in [*first, *rest]], row_of),
        slopes_end=len(first),
        values=np.array([row_of[k] for k in outputs], dtype=np.int64),
        gradients=gradients,
        hessians=hessians,
        orders=orders,
        variables=np.array(variables, dtype=np.int64),
    )


def _tape(nodes: Sequence[Node], row_of: dict[int, int]) -> Tape:
    first = [row_of[node.first] if node.operation not in op.NO_ARGUMENTS else node.first for node in nodes]
    second = [row_of[node.second] if node.operation in op.TWO_ARGUMENTS else node.second for node in nodes]
    second = [k if node.operation not in _ONE_ARGUMENT else 0 for node, k in zip(nodes, second, strict=True)]
    return Tape(
        operations=np.array([node.operation for node in nodes], dtype=np.int64),
        first=np.array(first, dtype=np.int64),
        second=np.array(second, dtype=np.int64),
        constants=np.array([node.bounds for node in nodes]).reshape(-1, 2),
    )


_ONE_ARGUMENT = frozenset(range(op.MAX + 1)) - op.TWO_ARGUMENTS - {op.POWER}


def affine(graph: Graph, output: int, variables: Sequence[int]) -> tuple[list[float], float] | None:
    """Coefficients (p,) and offset of an output that is affine in all its variables with doubles, else ``None``."""
    if not graph.variables_of(output) <= set(variables):
        return None
    slopes = [graph.value(graph.derivative(output, j)) for j in variables]
    offset = _at_zero(graph, output)
    if offset is None or any(slope is None for slope in slopes):
        return None
    try:
        rounded = float(offset)
    except OverflowError:
        return None
    return ([float(s) for s in slopes if s is not None], rounded) if Fraction(rounded) == offset else None


def _at_zero(graph: Graph, output: int) -> Fraction | None:
    """The exact value where all variables are 0, of arithmetic alone."""
    known: dict[int, Fraction] = {}
    for k in graph.below([output]):
        node = graph.nodes[k]
        values = [known[a] for a in arguments(node)]
        if node.operation == op.CONSTANT and node.bounds[0] == node.bounds[1]:
            known[k] = Fraction(node.bounds[0])
        elif node.operation == op.VARIABLE:
            known[k] = Fraction(0)
        elif node.operation == op.ADD:
            known[k] = values[0] + values[1]
        elif node.operation == op.SUBTRACT:
            known[k] = values[0] - values[1]
        elif node.operation == op.MULTIPLY:
            known[k] = values[0] * values[1]
        elif node.operation == op.NEGATE:
            known[k] = -values[0]
        elif node.operation == op.DIVIDE and values[1] != 0:
            known[k] = values[0] / values[1]
        else:
            return None
    return known[output]
