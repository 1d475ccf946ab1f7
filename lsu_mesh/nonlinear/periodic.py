"""Angles of which an output is known up to turns: where any branch of ``atan2`` will do.

``atan2`` on a half-plane across its cut differs from the principal value by 2π. An output with a period absorbs that
where the angle enters as a sum with a factor whose product with 2π is a whole multiple of the period.
"""

from __future__ import annotations

import math
from fractions import Fraction

from lsu_mesh.kernels.intervals import operations as op
from lsu_mesh.nonlinear.graph import Graph

DEGREES = 180.0


def free_of_branches(graph: Graph, output: int, period: float) -> int:
    """The same function, up to whole periods, with every ``atan2`` that may take any branch marked so."""
    if period == 0.0:
        return output
    node = graph.nodes[output]
    if node.operation == op.ATAN2 and _is_turns(period, 1.0):
        return graph.call(op.ATAN2_ANY, node.first, node.second)
    if node.operation == op.NEGATE:
        return graph.negate(free_of_branches(graph, node.first, period))
    if node.operation == op.ADD:
        return graph.add(free_of_branches(graph, node.first, period), free_of_branches(graph, node.second, period))
    if node.operation == op.SUBTRACT:
        left = free_of_branches(graph, node.first, period)
        return graph.subtract(left, free_of_branches(graph, node.second, period))
    if node.operation in (op.MULTIPLY, op.DIVIDE):
        return _scaled(graph, output, period)
    return output


def _is_turns(period: float, factor: float) -> bool:
    """Whether ``factor 2π`` is a whole multiple of a period of 2π, π, …, each by the double nearest to it."""
    ratio = factor * 2.0 * math.pi / period
    whole = round(ratio)
    return whole != 0 and period == factor * 2.0 * math.pi / whole


def _scaled(graph: Graph, output: int, period: float) -> int:
    """``atan2(…) * 180 / pi`` in its usual forms, with a period of 360 or a whole fraction of it."""
    node = graph.nodes[output]
    places: list[tuple[int, int]] = []
    factor, has_pi, inner = Fraction(1), 0, output
    while True:
        node = graph.nodes[inner]
        if node.operation not in (op.MULTIPLY, op.DIVIDE):
            break
        for which, other in ((node.second, node.first), (node.first, node.second)):
            constant = graph.nodes[which]
            if constant.operation == op.CONSTANT and (node.operation == op.MULTIPLY or which == node.second):
                sign = 1 if node.operation == op.MULTIPLY else -1
                value = graph.value(which)
                if value is None:
                    if constant.bounds != (math.pi, math.nextafter(math.pi, 4.0)):
                        return output
                    has_pi += sign
                elif value == 0.0:
                    return output
                else:
                    factor *= Fraction(value) ** sign
                places.append((node.operation, which))
                inner = other
                break
        else:
            return output
    node = graph.nodes[inner]
    if node.operation != op.ATAN2:
        return output
    is_exact = has_pi == -1 and (factor * 2 / Fraction(period)).denominator == 1
    if not is_exact and not (has_pi == 0 and _is_turns(period, float(factor))):
        return output
    made = graph.call(op.ATAN2_ANY, node.first, node.second)
    for operation, which in reversed(places):
        made = graph.multiply(made, which) if operation == op.MULTIPLY else graph.divide(made, which)
    return made
