"""A body on a line with piecewise constant acceleration, in rationals: the truth between and at all moments."""

from __future__ import annotations

from bisect import bisect_right
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from lsu_mesh import LSUModel, Orthotope
from lsu_mesh.model import ContinuousModel
from lsu_mesh.testing.exact_plant import Exact

SECOND = 10**9


class Scene(NamedTuple):
    """A continuous model of position and velocity, what is known of the start, and the reports of one seed."""

    flow: ContinuousModel
    prior: Orthotope
    course: Course
    times: list[int]
    Y: np.ndarray


class Course:
    """Position and velocity (exact) from ``x1`` at time 0; the acceleration switches at given moments."""

    def __init__(self, x1: Exact, switches: list[int], accelerations: list[Fraction]) -> None:
        self._switches, self._accelerations, self._states = switches, accelerations, [x1]
        for i in range(1, len(switches)):
            self._states.append(self._moved(i - 1, switches[i]))

    def at(self, time_ns: int) -> Exact:
        """(position, velocity) at any moment from the first switch on."""
        return self._moved(bisect_right(self._switches, time_ns) - 1, time_ns)

    def _moved(self, i: int, time_ns: int) -> Exact:
        t, a, (position, velocity) = (
            Fraction(time_ns - self._switches[i], SECOND),
            self._accelerations[i],
            self._states[i],
        )
        return [position + velocity * t + a * t * t / 2, velocity + a * t]


def scene(
    seed: int, speed: float, acceleration: float, r: float, apart: tuple[float, float], rows: int, clock_ns: int = 0
) -> Scene:
    """A body of about this speed; reports so many seconds apart, in error by exactly ± r.

    The acceleration is at its bounds and switches at random. Where ``clock_ns`` > 0 each report is of a moment up to so
    much before or after its stamp.
    """
    rng = np.random.default_rng(seed)
    flow = LSUModel.continuous([[0.0, 1.0], [0.0, 0.0]], None, [[1.0, 0.0]], [acceleration], [r], [[0.0], [1.0]])
    gaps = [int(rng.integers(round(apart[0] * SECOND), round(apart[1] * SECOND))) for _ in range(rows)]
    times = [SECOND + int(v) for v in np.cumsum(gaps)]
    switches = sorted({0, *(int(v) for v in rng.integers(0, times[-1], 2 * rows))})
    signs = rng.choice([-1, 1], len(switches))
    x1 = [Fraction(float(v)) for v in (rng.uniform(-1, 1), speed + rng.uniform(-0.5, 0.5))]
    course = Course(x1, switches, [Fraction(acceleration) * int(sign) for sign in signs])
    off = rng.choice([-1, 1], rows) * clock_ns if clock_ns else np.zeros(rows, dtype=int)
    Y = np.array(
        [[_report(course.at(t + int(e))[0], r, int(rng.choice([-1, 1])))] for t, e in zip(times, off, strict=True)]
    )
    start = course.at(times[0])
    center = np.array([float(start[0]) + rng.uniform(-1, 1), float(start[1]) + rng.uniform(-0.5, 0.5)])
    reach = np.array([1.5, 1.0])
    return Scene(flow, Orthotope(center - reach, center + reach), course, times, Y)


def _report(position: Fraction, r: float, sign: int) -> float:
    """The double next to ``position ± r`` that is not farther from the position than r."""
    y = float(position + sign * Fraction(r))
    while abs(Fraction(y) - position) > Fraction(r):
        y = float(np.nextafter(y, float(position)))
    return y


def inside(lower: np.ndarray, upper: np.ndarray, x: Exact) -> bool:
    """Whether the exact state lies in the box; no tolerance."""
    return all(Fraction(a) <= v <= Fraction(z) for a, v, z in zip(lower.tolist(), x, upper.tolist(), strict=True))
