"""Expressions as a graph in which equal subexpressions are one node."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import NamedTuple

from lsu_mesh.errors import ModelError
from lsu_mesh.kernels.intervals import operations as op

MAX_NODES = 20_000
"""So many operations, those of the derivatives among them, and a model is refused."""


class Node(NamedTuple):
    """An operation on earlier nodes; ``first`` may be a variable's number, ``second`` a power's exponent."""

    operation: int
    first: int = 0
    second: int = 0
    bounds: tuple[float, float] = (0.0, 0.0)


class Graph:
    """Nodes by number; each is made from earlier ones, and simplified only where that changes no value.

    Parameters
    ----------
    names:
        Of the variables, in their order.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.names = tuple(names)
        self.nodes: list[Node] = []
        self._numbers: dict[Node, int] = {}
        self._derivatives: dict[tuple[int, int], int] = {}
        self._depends: dict[int, frozenset[int]] = {}

    # -- making nodes

    def _add(self, node: Node) -> int:
        number = self._numbers.get(node)
        if number is None:
            if len(self.nodes) >= MAX_NODES:
                raise ModelError(
                    f"the expressions and their derivatives take more than {MAX_NODES} operations; write less of them"
                )
            number = self._numbers[node] = len(self.nodes)
            self.nodes.append(node)
        return number

    def constant(self, low: float, high: float | None = None) -> int:
        """A number, or an interval that holds it."""
        return self._add(Node(op.CONSTANT, bounds=(low + 0.0, (low if high is None else high) + 0.0)))

    def variable(self, number: int) -> int:
        """The variable of a number."""
        return self._add(Node(op.VARIABLE, number))

    def value(self, i: int) -> float | None:
        """The number that node i is, ``None`` where it is no exact constant."""
        node = self.nodes[i]
        return node.bounds[0] if node.operation == op.CONSTANT and node.bounds[0] == node.bounds[1] else None

    def _exact(self, i: int, j: int, combine: Callable[[Fraction, Fraction], Fraction]) -> int | None:
        """The constant that two constants make, where that is a double."""
        a, b = self.value(i), self.value(j)
        if a is None or b is None:
            return None
        exact = combine(Fraction(a), Fraction(b))
        try:
            rounded = float(exact)
        except OverflowError:
            return None
        return self.constant(rounded) if Fraction(rounded) == exact else None

    def add(self, i: int, j: int) -> int:
        """i + j"""
        if self.value(i) == 0.0:
            return j
        if self.value(j) == 0.0:
            return i
        found = self._exact(i, j, lambda a, b: a + b)
        return self._add(Node(op.ADD, i, j)) if found is None else found

    def subtract(self, i: int, j: int) -> int:
        """i − j"""
        if self.value(j) == 0.0:
            return i
        if i == j:
            return self.constant(0.0)
        if self.value(i) == 0.0:
            return self.negate(j)
        found = self._exact(i, j, lambda a, b: a - b)
        return self._add(Node(op.SUBTRACT, i, j)) if found is None else found

    def negate(self, i: int) -> int:
        """−i"""
        node = self.nodes[i]
        if node.operation == op.CONSTANT:
            return self.constant(-node.bounds[1], -node.bounds[0])
        return node.first if node.operation == op.NEGATE else self._add(Node(op.NEGATE, i))

    def multiply(self, i: int, j: int) -> int:
        """i · j"""
        for one, other in ((i, j), (j, i)):
            factor = self.value(one)
            if factor == 0.0:
                return self.constant(0.0)
            if factor == 1.0:
                return other
            if factor == -1.0:
                return self.negate(other)
        if i == j:
            return self._add(Node(op.SQUARE, i))
        found = self._exact(i, j, lambda a, b: a * b)
        return self._add(Node(op.MULTIPLY, i, j)) if found is None else found

    def divide(self, i: int, j: int) -> int:
        """i / j"""
        divisor = self.value(j)
        if divisor == 1.0:
            return i
        if divisor is not None and divisor != 0.0:
            found = self._exact(i, j, lambda a, b: a / b)
            if found is not None:
                return found
        return self._add(Node(op.DIVIDE, i, j))

    def power(self, i: int, exponent: int) -> int:
        """i to a whole power"""
        if exponent in (0, 1):
            return i if exponent else self.constant(1.0)
        return self.multiply(i, i) if exponent == 2 else self._add(Node(op.POWER, i, exponent))

    def call(self, operation: int, i: int, j: int = 0) -> int:
        """A function of one or two nodes."""
        return self._add(Node(operation, i, j))

    # -- derivatives

    def variables_of(self, i: int) -> frozenset[int]:
        """The numbers of the variables that node i depends on."""
        known = self._depends
        for k in range(len(known), i + 1):
            node = self.nodes[k]
            if node.operation == op.VARIABLE:
                known[k] = frozenset({node.first})
            else:
                known[k] = frozenset().union(*(known[a] for a in arguments(node)))
        return known[i]

    def derivative(self, i: int, v: int) -> int:
        """The node ``∂i / ∂v``, v the number of a variable."""
        waiting = [i]
        while waiting:
            k = waiting[-1]
            if (k, v) in self._derivatives:
                waiting.pop()
                continue
            if v not in self.variables_of(k):
                self._derivatives[k, v] = self.constant(0.0)
                waiting.pop()
                continue
            missing = [a for a in arguments(self.nodes[k]) if (a, v) not in self._derivatives]
            if missing:
                waiting += missing
                continue
            waiting.pop()
            self._derivatives[k, v] = self._chain(k, v)
        return self._derivatives[i, v]

    def _chain(self, k: int, v: int) -> int:
        node = self.nodes[k]
        if node.operation == op.VARIABLE:
            return self.constant(1.0)
        inner = [self._derivatives[a, v] for a in arguments(node)]
        if node.operation in (op.MIN, op.MAX):
            raise ModelError("min and max have no derivative; write the model without them")
        total = self.constant(0.0)
        for slope, change in zip(self._slopes(k, node), inner, strict=True):
            if self.value(change) != 0.0:
                total = self.add(total, self.multiply(slope(), change))
        return total

    def _slopes(self, k: int, node: Node) -> list[Callable[[], int]]:
        """The partial derivatives of an operation by its arguments, made when they are needed."""
        i, j, one, const = node.first, node.second, self.constant(1.0), self.constant
        if node.operation in (op.ATAN2, op.ATAN2_ANY):
            size = self.add(self._square(i), self._square(j))
            return [lambda: self.divide(j, size), lambda: self.negate(self.divide(i, size))]
        two: dict[int, list[Callable[[], int]]] = {
            op.ADD: [lambda: one, lambda: one],
            op.SUBTRACT: [lambda: one, lambda: const(-1.0)],
            op.MULTIPLY: [lambda: j, lambda: i],
            op.DIVIDE: [lambda: self.divide(one, j), lambda: self.negate(self.divide(k, j))],
        }
        if node.operation in two:
            return two[node.operation]
        rules: dict[int, Callable[[], int]] = {
            op.NEGATE: lambda: const(-1.0),
            op.SQUARE: lambda: self.multiply(const(2.0), i),
            op.POWER: lambda: self.multiply(const(float(j)), self.power(i, j - 1)),
            op.SQRT: lambda: self.divide(const(0.5), k),
            op.EXP: lambda: k,
            op.LOG: lambda: self.divide(one, i),
            op.SIN: lambda: self.call(op.COS, i),
            op.COS: lambda: self.negate(self.call(op.SIN, i)),
            op.TAN: lambda: self.add(one, self._square(k)),
            op.ATAN: lambda: self.divide(one, self.add(one, self._square(i))),
            op.ASIN: lambda: self.divide(one, self.call(op.SQRT, self.subtract(one, self._square(i)))),
            op.ACOS: lambda: self.negate(self.divide(one, self.call(op.SQRT, self.subtract(one, self._square(i))))),
            op.ABS: lambda: self.call(op.SIGN, i),
            op.SINH: lambda: self.call(op.COSH, i),
            op.COSH: lambda: self.call(op.SINH, i),
            op.TANH: lambda: self.subtract(one, self._square(k)),
        }
        return [rules[node.operation]]

    def _square(self, i: int) -> int:
        return self.multiply(i, i)

    def has_kink(self, i: int) -> bool:
        """Whether node i goes through ``abs``, ``min`` or ``max``, which have no second derivative."""
        kinks = {op.ABS, op.SIGN, op.MIN, op.MAX}
        return any(self.nodes[k].operation in kinks for k in self.below([i]))

    def below(self, outputs: Iterable[int]) -> list[int]:
        """The nodes that some nodes are made from, and these, in order."""
        seen: set[int] = set()
        waiting = list(outputs)
        while waiting:
            k = waiting.pop()
            if k not in seen:
                seen.add(k)
                waiting += arguments(self.nodes[k])
        return sorted(seen)


def arguments(node: Node) -> list[int]:
    """The nodes that a node is made from."""
    if node.operation in op.NO_ARGUMENTS:
        return []
    return [node.first, node.second] if node.operation in op.TWO_ARGUMENTS else [node.first]
