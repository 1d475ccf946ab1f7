"""The language of models: Python's expressions of numbers, names, ``+ − * / **`` and a list of functions.

The text is parsed by :mod:`ast` and every node of it is compared with a short list; nothing is ever evaluated as code.
A decimal means the nearest double; only ``pi`` is an interval.
"""

from __future__ import annotations

import ast
import difflib
import math
from collections.abc import Mapping

from lsu_mesh.errors import ModelError
from lsu_mesh.kernels.intervals import operations as op
from lsu_mesh.nonlinear.graph import Graph

FUNCTIONS = {
    "sin": op.SIN, "cos": op.COS, "tan": op.TAN, "asin": op.ASIN, "acos": op.ACOS, "atan": op.ATAN, "atan2": op.ATAN2,
    "exp": op.EXP, "log": op.LOG, "sqrt": op.SQRT, "abs": op.ABS, "sinh": op.SINH, "cosh": op.COSH, "tanh": op.TANH,
    "hypot": op.SQRT,
}  # fmt: skip
TWO_ARGUMENTS = {"atan2", "hypot"}
MAX_TEXT = 100_000
"""So many characters in an expression."""
MAX_EXPONENT = 1_000
MAX_DEPTH = 200
"""So deep an expression may be nested, chains of + and * not counted."""


class ExpressionError(ModelError):
    """An expression that is not of the language: which, where, and what to write instead."""


def parse(text: str, graph: Graph, names: Mapping[str, int], what: str) -> int:
    """The node of an expression.

    Parameters
    ----------
    text:
        Such as ``"x + h*v*cos(th)"``.
    graph:
        Where the node is made.
    names:
        Node numbers by name: states, inputs, noises, parameters, ``h``.
    what:
        What the expression is called in errors, ``"f[0]"``.

    Raises
    ------
    ExpressionError
        With row, column, and the nearest name where one is unknown.
    """
    if not isinstance(text, str):
        raise ExpressionError(f"{what} must be a text such as 'x + h*v', it is {text!r}")
    if len(text) > MAX_TEXT:
        raise ExpressionError(f"{what} has {len(text)} characters, at most {MAX_TEXT} are taken")
    if "#" in text:
        raise ExpressionError(f"{what}: an expression has no comments, '#' is not part of the language: {_shown(text)}")
    flat = text.replace("\r", " ").replace("\n", " ").replace("\t", " ")  # a text may go over several rows
    start = len(flat) - len(flat.lstrip())
    try:
        tree = ast.parse(flat[start:], mode="eval")
    except SyntaxError as error:
        where = _place(text, start + max(0, (error.offset or 1) - 1))
        raise ExpressionError(f"{what}, {where}: {error.msg}: {_shown(text)}") from None
    except (RecursionError, MemoryError, ValueError):
        raise ExpressionError(f"{what} is nested too deeply, or holds a character that no expression has") from None
    return _Reader(text, start, graph, names, what=what).read(tree.body)


def _place(text: str, offset: int) -> str:
    """Row and column of a character, both from 1."""
    before = text[:offset]
    return f"row {before.count(chr(10)) + 1}, column {offset - before.rfind(chr(10))}"


def _shown(text: str) -> str:
    return repr(text if len(text) <= 80 else text[:77] + "…")


class _Reader:
    """Goes through the tree of one expression."""

    def __init__(self, text: str, start: int, graph: Graph, names: Mapping[str, int], what: str) -> None:
        self._text, self._start, self._graph, self._names, self._what = text, start, graph, names, what

    def _refuse(self, node: ast.AST, words: str) -> ExpressionError:
        offset = len(self._text[self._start :].encode()[: getattr(node, "col_offset", 0)].decode(errors="ignore"))
        where = _place(self._text, self._start + offset)
        return ExpressionError(f"{self._what}, {where}: {words} in {_shown(self._text)}")

    def read(self, node: ast.expr, depth: int = 0) -> int:
        """The graph's node; chains of binary operations are gone along without recursion."""
        if depth > MAX_DEPTH:
            raise self._refuse(node, f"nested more than {MAX_DEPTH} deep")
        chain: list[ast.BinOp] = []
        while isinstance(node, ast.BinOp) and not isinstance(node.op, ast.Pow):
            chain.append(node)
            node = node.left
        found = self._read_one(node, depth)
        for link in reversed(chain):
            found = self._combine(link, found, self.read(link.right, depth + 1))
        return found

    def _combine(self, node: ast.BinOp, left: int, right: int) -> int:
        graph = self._graph
        if isinstance(node.op, ast.Add):
            return graph.add(left, right)
        if isinstance(node.op, ast.Sub):
            return graph.subtract(left, right)
        if isinstance(node.op, ast.Mult):
            return graph.multiply(left, right)
        if isinstance(node.op, ast.Div):
            if graph.value(right) == 0.0:
                raise self._refuse(node.right, "division by 0")
            return graph.divide(left, right)
        raise self._refuse(node, "only + - * / ** are taken, here is another operator")

    def _read_one(self, node: ast.expr, depth: int) -> int:
        graph = self._graph
        if isinstance(node, ast.Constant):
            return self._number(node)
        if isinstance(node, ast.Name):
            return self._name(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            inner = self.read(node.operand, depth + 1)
            return graph.negate(inner) if isinstance(node.op, ast.USub) else inner
        if isinstance(node, ast.BinOp):
            return self._power(node, depth)
        if isinstance(node, ast.Call):
            return self._call(node, depth)
        raise self._refuse(node, f"{_described(node)} is not part of the language")

    def _number(self, node: ast.Constant) -> int:
        value = node.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self._refuse(node, f"{value!r} is no number")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self._refuse(node, "a number too large for a double")
        return self._graph.constant(number)

    def _name(self, node: ast.Name) -> int:
        if node.id in self._names:
            return self._names[node.id]
        if node.id == "pi":
            return self._graph.constant(math.pi, math.nextafter(math.pi, 4.0))
        if node.id in FUNCTIONS:
            raise self._refuse(node, f"the function {node.id} needs arguments, {node.id}(…),")
        raise self._refuse(node, f"unknown name {node.id!r}{self._nearest(node.id, [*self._names, 'pi'])}")

    @staticmethod
    def _nearest(name: str, known: list[str]) -> str:
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
        return f" (did you mean {near[0]!r}?)" if near else f" (known are {', '.join(sorted(known))})"

    def _power(self, node: ast.BinOp, depth: int) -> int:
        exponent = self._graph.value(self.read(node.right, depth + 1))
        if exponent is None or not (exponent.is_integer() or exponent == 0.5):
            raise self._refuse(node.right, "an exponent must be a whole number, or 0.5,")
        base = self.read(node.left, depth + 1)
        if exponent == 0.5:
            return self._graph.call(op.SQRT, base)
        if abs(exponent) > MAX_EXPONENT:
            raise self._refuse(node.right, f"an exponent must lie between −{MAX_EXPONENT} and {MAX_EXPONENT},")
        return self._graph.power(base, int(exponent))

    def _call(self, node: ast.Call, depth: int) -> int:
        if not isinstance(node.func, ast.Name):
            raise self._refuse(node.func, f"{_described(node.func)} cannot be called")
        name = node.func.id
        if name not in FUNCTIONS:
            raise self._refuse(node.func, f"unknown function {name!r}{self._nearest(name, list(FUNCTIONS))}")
        wanted = 2 if name in TWO_ARGUMENTS else 1
        if len(node.args) != wanted or node.keywords:
            raise self._refuse(node, f"{name} takes {wanted} argument(s), not {len(node.args) + len(node.keywords)},")
        given = [self.read(argument, depth + 1) for argument in node.args]
        if name == "hypot":
            squares = [self._graph.multiply(one, one) for one in given]
            return self._graph.call(op.SQRT, self._graph.add(*squares))
        return self._graph.call(FUNCTIONS[name], *given)


def _described(node: ast.AST) -> str:
    words = {
        ast.Attribute: "an attribute (a dot)", ast.Subscript: "an index in brackets", ast.Compare: "a comparison",
        ast.BoolOp: "and/or", ast.IfExp: "a condition", ast.Lambda: "a lambda", ast.Starred: "a star",
        ast.List: "a list", ast.Tuple: "a tuple (a comma)", ast.Dict: "a dictionary", ast.JoinedStr: "a string",
        ast.NamedExpr: "an assignment", ast.UnaryOp: "this operator",
    }  # fmt: skip
    return words.get(type(node), type(node).__name__)
