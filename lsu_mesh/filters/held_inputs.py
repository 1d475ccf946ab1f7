"""Inputs that are held between the moments at which they switch."""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.supports.orthotope import Orthotope

Input = Vector | Orthotope | None
"""A vector (p,), a box where the input is not known, or ``None`` for a model without inputs."""


class Piece(NamedTuple):
    """A stretch with one input; where it ``varies`` nothing is known but that it stays in the box ``u``."""

    length_ns: int
    u: Input
    varies: bool = False


class HeldInputs:
    """``values[i]`` acts from ``times_ns[i]`` on, up to the next switch; times increase.

    ``before``: what acts before the first switch; without it nothing is known there, and to ask is a ``ModelError``.
    ``delay_ns``, one or one for each switch: a switch takes place up to so much after its time, nobody knows when;
    until then the input varies between the two. The next switch must not come sooner than that.
    """

    def __init__(
        self,
        times_ns: Sequence[int],
        values: Sequence[Input],
        before: Input = None,
        *,
        delay_ns: int | Sequence[int] = 0,
    ) -> None:
        if len(times_ns) != len(values) or any(a >= b for a, b in itertools.pairwise(times_ns)):
            raise ModelError("inputs need one time each, and the times must increase")
        delays = (delay_ns,) * len(times_ns) if isinstance(delay_ns, int) else tuple(delay_ns)
        lengths = [b - a for a, b in itertools.pairwise(times_ns)]
        if min(delays, default=0) < 0 or any(h < e for h, e in zip(lengths, delays, strict=False)):
            raise ModelError(f"a delay of {max(delays)} ns must not be negative, nor longer than an input is held")
        if len(delays) != len(times_ns):
            raise ModelError(f"{len(times_ns)} switches need one delay, or one each, not {len(delays)}")
        self._times, self._values, self._before = tuple(times_ns), tuple(values), before
        self._settled = tuple(time + delay for time, delay in zip(times_ns, delays, strict=True))

    @classmethod
    def constant(cls, u: Input = None) -> HeldInputs:
        """One input for all times; ``None`` for a model without inputs."""
        return cls((), (), before=u)

    def at(self, time_ns: int) -> Input:
        """What acts from this moment on."""
        return self._value(bisect_right(self._times, time_ns) - 1)

    def pieces(self, start_ns: int, end_ns: int) -> Iterator[Piece]:
        """Each stretch between switches from start to end, in order."""
        index = bisect_right(self._times, start_ns) - 1
        while start_ns < end_ns:
            following = self._times[index + 1] if index + 1 < len(self._times) else end_ns
            settled = self._settled[index] if index >= 0 else start_ns
            if start_ns < settled:
                until = min(settled, following, end_ns)
                yield Piece(until - start_ns, self._between(index - 1, index), varies=True)
            else:
                until = min(following, end_ns)
                yield Piece(until - start_ns, self._value(index))
            start_ns, index = until, index + (until == following)

    def hull(self, start_ns: int, end_ns: int) -> Input:
        """One input, or a box, that holds every input that acts in [start, end]."""
        first = bisect_right(self._settled, start_ns) - 1
        return self._between(first, bisect_right(self._times, end_ns) - 1)

    def _between(self, first: int, last: int) -> Input:
        """The hull of these values."""
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
