"""Expressions whose values other code knows, for the tests of nonlinear models."""

from __future__ import annotations

from lsu_mesh.nonlinear.graph import Graph
from lsu_mesh.nonlinear.language import parse

NAMES = ("x", "y", "th")


def made(text: str) -> tuple[Graph, int]:
    graph = Graph(NAMES)
    return graph, parse(text, graph, {name: graph.variable(i) for i, name in enumerate(NAMES)}, "f[0]")


TEXTS = {
    "x + 2*y - th/3": lambda m, x, y, th: x + 2 * y - th / 3,
    "-x**3 + (x - y)**2 * th": lambda m, x, y, th: -(x**3) + (x - y) ** 2 * th,
    "x**-2 + +y": lambda m, x, y, th: x**-2 + y,
    "sin(x)*cos(y) - tan(th)": lambda m, x, y, th: m.sin(x) * m.cos(y) - m.tan(th),
    "sqrt(x*x + y**2) + x**0.5": lambda m, x, y, th: m.sqrt(x * x + y**2) + m.sqrt(x),
    "hypot(x + 1, y + 2)": lambda m, x, y, th: m.hypot(x + 1, y + 2),
    "atan2(y, x) - th": lambda m, x, y, th: m.atan2(y, x) - th,
    "exp(-x/4) * log(y)": lambda m, x, y, th: m.exp(-x / 4) * m.log(y),
    "abs(th - 5) + atan(x) + asin(th/2) + acos(th/2)": lambda m, x, y, th: (
        abs(th - 5) + m.atan(x) + m.asin(th / 2) + m.acos(th / 2)
    ),
    "sinh(x) + cosh(y) - tanh(th)": lambda m, x, y, th: m.sinh(x) + m.cosh(y) - m.tanh(th),
    "2*pi*x": lambda m, x, y, th: 2 * m.pi * x,
    "x\n+ y": lambda m, x, y, th: x + y,
}
