"""The constraints of several sets of one step, stacked into one constrained zonotope that is reduced once.

A stack is never changed: whatever begins with the same sets can begin with the same stack.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.constrained_intersection import cuts, finite_body, strips_of, with_strips
from lsu_mesh.filters.constrained_state import log_size
from lsu_mesh.filters.lsucz import LITTLE_GAIN
from lsu_mesh.filters.transfer_gain import hull_gain
from lsu_mesh.kernels.linear_programs.safe_maxima import EMPTY, LOOSE
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_sets
from lsu_mesh.kernels.zonotopes.stack_reduction import settle_stack
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.linear_programs import safe_maxima
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.reduction import Body, Limits, Settled
from lsu_mesh.supports.support import Support

Told: TypeAlias = tuple[Support, tuple[Vector, Vector]]
"""A set, and bounds (lower, upper), (n,) each, of what it says."""

NO_LIMITS = Limits(None, None)
MAX_STACKED = 4
"""A stack with more than so many times the generators that are allowed is reduced before the next set is met."""
MAX_COMPLEXITY = 3
"""A set with more than so many times the generators that are allowed is taken by its box."""


class Stack(NamedTuple):
    """``first ∩ sets met``: the state lies in the set with arrays ``body`` = (c, G, A, b) and in [lower, upper].

    A box is no part of the body before :meth:`closed`: many boxes then cost one strip per coordinate.
    """

    first: Settled
    """The set that the stack began with, and a box that holds all of it that matters."""
    body: Body
    lower: Vector
    upper: Vector
    limits: Limits

    @classmethod
    def of(cls, body: Body, lower: Vector, upper: Vector, limits: Limits) -> Stack:
        """A stack of one set, (c, G, A, b) ∩ [lower, upper]."""
        return cls(Settled(body, lower, upper, empty=False), body, lower, upper, limits=limits)

    @classmethod
    def of_support(cls, support: Support, bounds: tuple[Vector, Vector], limits: Limits) -> Stack:
        """A stack of one set of any kind, and of a box (lower, upper) that is known beside it."""
        stack = cls.of(support.to_constrained_zonotope().arrays, *support.bounds(), limits)
        return stack._within(*bounds)

    def met(self, support: Support, bounds: tuple[Vector, Vector]) -> Stack:
        """``self ∩ support ∩ [bounds]``, by as few constraints as the sets need; exact but for rounding outward.

        A box, a parallelotope and a bundle are strips, and only those that cut ``first`` are taken. Raises
        ``InconsistentData`` where boxes are disjoint.
        """
        stack = self._reduced()._within(*bounds)
        for part in _parts(support):
            stack = stack._met_part(part)
        return stack

    def settled(self) -> Settled:
        """The set within the limits, and the hull of the set *before* its reduction, met with the box.

        Sets that bring next to nothing, so that reducing the intersection costs more, change only the box that is held:
        a wide source does no harm. Raises ``InconsistentData`` where the intersection is proved empty.
        """
        body = self.closed()
        limits = NO_LIMITS if body is self.first.body else self.limits
        found = _settle(body, self.lower, self.upper, limits)
        gain = hull_gain((self.first.lower, self.first.upper), (found.lower, found.upper))
        if found.body is body or gain >= LITTLE_GAIN:
            return found
        widths = found.upper - found.lower
        is_smaller = log_size(self.first.body, widths) <= log_size(found.body, widths)
        return found._replace(body=self.first.body) if is_smaller else found

    def closed(self) -> Body:
        """The set (c, G, A, b), with a strip for each coordinate in which the box is narrower than the first."""
        does_cut = (self.lower > self.first.lower) | (self.upper < self.first.upper)
        if not does_cut.any():
            return self.body
        box = Orthotope(self.lower, self.upper)
        return with_strips(self.body, np.eye(box.dim), np.where(does_cut, box.center, np.nan), box.half_widths)

    def _within(self, lower: Vector, upper: Vector) -> Stack:
        met = self._replace(lower=np.maximum(self.lower, lower), upper=np.minimum(self.upper, upper))
        if (met.lower > met.upper).any():
            raise InconsistentData("the boxes of the supports have no common point")
        return met

    def _reduced(self) -> Stack:
        """The stack itself, or one of its reduced set where it has grown too large."""
        limit = self.limits.generators
        if limit is None or self.body[1].shape[1] <= MAX_STACKED * limit:
            return self
        settled = self.settled()
        return Stack(settled, settled.body, settled.lower, settled.upper, limits=self.limits)

    def _met_part(self, part: Support) -> Stack:
        if isinstance(part, Orthotope):
            return self._within(part.lower, part.upper)
        strips = strips_of(part)
        if strips is not None:
            P, y, r = strips
            does_cut = cuts((self.first.lower, self.first.upper), part, P, y=y, r=r)
            middle = np.where(does_cut, y, np.nan)
            return self._replace(body=with_strips(self.body, P, middle, r)) if does_cut.any() else self
        met, limit = part.to_constrained_zonotope(), self.limits.generators
        if limit is not None and met.generator_count > MAX_COMPLEXITY * max(limit, part.dim):
            return self._within(*part.bounds())
        return self._replace(body=finite_body((self.body[0], *meet_sets(*self.body, *met.arrays)), self.body))


class Families:
    """Stacks of families of sets; the stack of sets with which several families begin is built once."""

    def __init__(self, first: Stack | None, sets: Sequence[Told], limits: Limits) -> None:
        """``first`` is in each family; without it the family's own first set begins the stack."""
        self._first = first
        self._sets = sets
        self._limits = limits
        self._known: dict[tuple[int, ...], Stack | None] = {}

    def stack(self, family: tuple[int, ...]) -> Stack | None:
        """The stack of the sets with these indices, in this order; ``None`` where boxes are disjoint."""
        if family not in self._known:
            try:
                self._known[family] = self._stacked(family)
            except InconsistentData:
                self._known[family] = None
        return self._known[family]

    def settled(self, family: tuple[int, ...]) -> Settled | None:
        """The same within the limits; ``None`` where the intersection is proved empty."""
        stack = self.stack(family)
        try:
            return None if stack is None else stack.settled()
        except InconsistentData:
            return None

    def _stacked(self, family: tuple[int, ...]) -> Stack | None:
        if not family:
            return self._first
        *others, last = family
        support, bounds = self._sets[last]
        if not others and self._first is None:
            return Stack.of_support(support, bounds, self._limits)
        before = self.stack(tuple(others))
        return None if before is None else before.met(support, bounds)


def _parts(support: Support) -> Iterator[Support]:
    """The sets whose intersection a set is."""
    if isinstance(support, Intersection):
        for part in support.parts:
            yield from _parts(part)
    else:
        yield support


def _settle(body: Body, lower: Vector, upper: Vector, limits: Limits) -> Settled:
    """:func:`settle_stack` met with the box [lower, upper]; ``InconsistentData`` where nothing is left."""
    c, G, A, b = body
    n = c.size
    most = [-1 if limit is None else limit for limit in limits]
    status, values, reduced = settle_stack(c, G, A, b, *most)
    if status == LOOSE:  # another solver may do better
        maxima = safe_maxima(np.concatenate((G, -G)), A, b)
        values, status = maxima.values, EMPTY if maxima.empty else LOOSE
    upper = np.minimum(upper, np.nextafter(c + values[:n], np.inf))
    lower = np.maximum(lower, np.nextafter(c - values[n:], -np.inf))
    if status == EMPTY or (lower > upper).any():
        raise InconsistentData("the supports are proved to have no common point")
    return Settled(body if limits.allow(body) else reduced, lower, upper, empty=False)
