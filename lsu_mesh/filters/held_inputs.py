"""Inputs that are held between the moments at which they switch."""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Iterator, Sequence

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.supports.orthotope import Orthotope

Input = Vector | Orthotope | None
"""A vector (p,), a box where the input is not known, or ``None`` for a model without inputs."""


class HeldInputs:
    """``values[i]`` acts from ``times_ns[i]`` on, up to the next switch; times increase.

    ``before``: what acts before the first switch; without it nothing is known there, and to ask is a ``ModelError``.
    """

    def __init__(self, times_ns: Sequence[int], values: Sequence[Input], before: Input = None) -> None:
        if len(times_ns) != len(values) or any(a >= b for a, b in itertools.pairwise(times_ns)):
            raise ModelError("inputs need one time each, and the times must increase")
        self._times, self._values, self._before = tuple(times_ns), tuple(values), before

    @classmethod
    def constant(cls, u: Input = None) -> HeldInputs:
        """One input for all times; ``None`` for a model without inputs."""
        return cls((), (), before=u)

    def at(self, time_ns: int) -> Input:
        """What acts from this moment on."""
        return self._value(bisect_right(self._times, time_ns) - 1)

    def pieces(self, start_ns: int, end_ns: int) -> Iterator[tuple[int, Input]]:
        """``(length in ns, input)`` of each stretch between switches from start to end, in order."""
        index = bisect_right(self._times, start_ns) - 1
        while start_ns < end_ns:
            following = self._times[index + 1] if index + 1 < len(self._times) else end_ns
            until = min(following, end_ns)
            yield until - start_ns, self._value(index)
            start_ns, index = until, index + 1

    def hull(self, start_ns: int, end_ns: int) -> Input:
        """One input, or a box, that holds every input that acts in [start, end]."""
        first, last = bisect_right(self._times, start_ns) - 1, bisect_right(self._times, end_ns) - 1
        values = [self._value(i) for i in range(first, last + 1)]
        if len(values) == 1 or any(value is None for value in values):
            return values[0]
        bounds = [value.bounds() if isinstance(value, Orthotope) else (value, value) for value in values]
        return Orthotope(
            np.min([np.asarray(low) for low, _ in bounds], axis=0),
            np.max([np.asarray(high) for _, high in bounds], axis=0),
        )

    def _value(self, index: int) -> Input:
        return self._before if index < 0 else self._values[index]
