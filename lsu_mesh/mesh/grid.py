"""The grid of a mesh, ``t_k = start + round_ns(k dt)``, in integer nanoseconds.

``dt`` is an exact fraction of seconds, so that a grid of 1/30 s does not drift; ``k dt`` is rounded to the nearest
nanosecond, halves to the even one.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lsu_mesh.array_types import Integers
from lsu_mesh.errors import ModelError

NS = 10**9
_SAFE = 2**62


@dataclass(frozen=True)
class Grid:
    """``t_k = start_ns + round(k dt · 10⁹)``, k = 1, 2, …; ``dt`` in seconds, at least a nanosecond.

    The functions of arrays (T,) take and return int64; those of one moment take and return ``int``.
    Raises :class:`lsu_mesh.errors.ModelError` where ``dt`` or the start cannot be counted in nanoseconds.
    """

    start_ns: int
    dt: Fraction

    def __post_init__(self) -> None:
        if self.dt * NS < 1:
            raise ModelError(f"dt = {self.dt} s is below a nanosecond, the resolution of time; take a larger one")
        if self.dt * NS >= _SAFE or abs(self.start_ns) >= _SAFE:
            raise ModelError(
                f"dt = {self.dt} s from {self.start_ns} ns is beyond the ±146 years that are counted in ns"
            )

    def time_of(self, k: int) -> int:
        """``t_k`` in ns."""
        step, parts = self._step_ns
        whole, rest = divmod(k * step, parts)
        is_up = 2 * rest > parts or (2 * rest == parts and whole % 2 == 1)
        return self.start_ns + whole + is_up

    @functools.cached_property
    def _step_ns(self) -> tuple[int, int]:
        """``dt · 10⁹`` as numerator and denominator: whole numbers are ten times as fast as fractions."""
        step_ns = self.dt * NS
        return step_ns.numerator, step_ns.denominator

    def step_of(self, t_ns: int) -> int:
        """The step k with ``t_{k−1} < t ≤ t_k``."""
        since = t_ns - self.start_ns
        k = -((-since * self.dt.denominator) // (self.dt.numerator * NS))
        return k - 1 if self.time_of(k - 1) >= t_ns else k

    def nearest_step(self, t_ns: int) -> int:
        """The step whose ``t_k`` is nearest; the earlier one of two."""
        k = self.step_of(t_ns)
        return k - 1 if t_ns - self.time_of(k - 1) <= self.time_of(k) - t_ns else k

    def distance(self, t_ns: int) -> int:
        """``min over k of |t − t_k|`` in ns."""
        return abs(t_ns - self.time_of(self.nearest_step(t_ns)))

    def is_on_grid(self, t_ns: int, half_ns: int = 0) -> bool:
        """Whether ``[t − half, t + half]`` holds a ``t_k``."""
        return self.distance(t_ns) <= half_ns

    def times_of(self, k: Integers) -> Integers:
        """:meth:`time_of` of an array."""
        step_ns = self.dt * NS
        p, q = step_ns.numerator, step_ns.denominator
        if not self._fits(k, p, q):
            return np.array([self.time_of(one) for one in k.tolist()], dtype=np.int64)
        if q == 1:
            on_whole_ns: Integers = self.start_ns + k * p
            return on_whole_ns
        whole, rest = np.divmod(k, q)
        part, over = np.divmod(rest * p, q)
        up = (2 * over > q) | ((2 * over == q) & ((whole * p + part) % 2 == 1))
        times: Integers = self.start_ns + whole * p + part + up
        return times

    def steps_of(self, t_ns: Integers) -> Integers:
        """:meth:`step_of` of an array."""
        step_ns = self.dt * NS
        p, q = step_ns.numerator, step_ns.denominator
        if q * p >= _SAFE or not self._is_near(t_ns):
            return np.array([self.step_of(one) for one in t_ns.tolist()], dtype=np.int64)
        # since = a p + b with 0 ≤ b < p, so ceil(since q / p) = a q + ceil(b q / p)
        a, b = np.divmod(t_ns - self.start_ns, p)
        k: Integers = a * q - (-b * q) // p
        k -= self.times_of(k - 1) >= t_ns
        return k

    def nearest_steps(self, t_ns: Integers) -> Integers:
        """:meth:`nearest_step` of an array."""
        k = self.steps_of(t_ns)
        nearest: Integers = k - (t_ns - self.times_of(k - 1) <= self.times_of(k) - t_ns)
        return nearest

    def distances(self, t_ns: Integers) -> Integers:
        """:meth:`distance` of an array."""
        distances: Integers = np.abs(t_ns - self.times_of(self.nearest_steps(t_ns)))
        return distances

    def _fits(self, k: Integers, p: int, q: int) -> bool:
        """Whether all numbers of :meth:`times_of` stay below 2⁶³."""
        largest = max((abs(int(end)) for end in (k.min(), k.max())), default=0) if k.size else 0
        return q * p < _SAFE and (largest + q) * p // q + abs(self.start_ns) + p < _SAFE

    def _is_near(self, t_ns: Integers) -> bool:
        """Whether all numbers of :meth:`steps_of` stay below 2⁶³."""
        if not t_ns.size:
            return True
        return all(abs(int(end) - self.start_ns) * self.dt.denominator < _SAFE for end in (t_ns.min(), t_ns.max()))
