"""A car on a road, and what its receiver reports: python make_data.py writes reports.csv.

The car goes at about 20 m/s; its acceleration is within ±3 m/s² and changes at any moment. The receiver reports the
position to ±0.5 m, .15 to .5 s apart. Everything is counted in whole milliseconds and millimetres, so that the truth is
a rational number and is known exactly.
"""

from __future__ import annotations

import random
from bisect import bisect_right
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
SEED, REPORTS = 14, 200
ACCELERATION, ERROR_MM = 3, 500
APART_MS = (150, 500)
FIRST_MS = 100
"""The first report, and step 1."""
SPEED = Fraction(20)


class Course:
    """Position (m) and speed (m/s), both exact, under an acceleration that is constant between its changes."""

    def __init__(self, changes_ms: Sequence[int], accelerations: Sequence[Fraction]) -> None:
        self._changes, self._accelerations = changes_ms, accelerations
        self._states = [(Fraction(0), SPEED)]
        for i, change in enumerate(changes_ms[1:]):
            self._states.append(self._moved(i, Fraction(change, 1000)))

    def at(self, seconds: Fraction) -> tuple[Fraction, Fraction]:
        """Position and speed at a moment from 0 on."""
        return self._moved(bisect_right(self._changes, seconds * 1000) - 1, seconds)

    def _moved(self, i: int, seconds: Fraction) -> tuple[Fraction, Fraction]:
        t, a, (position, speed) = (
            seconds - Fraction(self._changes[i], 1000),
            self._accelerations[i],
            self._states[i],
        )
        return position + speed * t + a * t * t / 2, speed + a * t


class Report(NamedTuple):
    """A row of the file."""

    ms: int
    mm: int


def drive(seed: int = SEED, reports: int = REPORTS) -> tuple[Course, list[Report]]:
    """The course of a car, and the reports on it."""
    rng = random.Random(seed)
    times = [FIRST_MS]
    while len(times) < reports:
        times.append(times[-1] + rng.randint(*APART_MS))
    changes = [0, *sorted(rng.sample(range(1, times[-1]), reports // 2))]
    course = Course(changes, [Fraction(rng.randint(-100, 100) * ACCELERATION, 100) for _ in changes])
    return course, [Report(ms, _reported(course.at(Fraction(ms, 1000))[0], rng)) for ms in times]


def _reported(position: Fraction, rng: random.Random) -> int:
    """Whole millimetres that are never farther than the error from the position."""
    exact = position * 1000
    return rng.randint(int(exact) - ERROR_MM + 1, int(exact) + ERROR_MM - 1)


def text(reports: Sequence[Report]) -> str:
    """The file: seconds and metres to three digits, which is all there is."""
    rows = [f"{ms // 1000}.{ms % 1000:03d},{mm // 1000}.{mm % 1000:03d}\n" for ms, mm in reports]
    return "".join(["time,position\n", *rows])


if __name__ == "__main__":
    (HERE / "reports.csv").write_text(text(drive()[1]), encoding="utf-8")
