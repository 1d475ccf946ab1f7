"""Can the model explain a flight at all? The smallest bounds that do, by linear programming over the whole flight.

    python explain.py aircraft_carrier

Variables are the altitude H and the climb rate v of every second; two consecutive seconds are joined by the motion that
``|a(t)| <= a`` allows (the hexagon around all of them), and every report lies within ±12.5 ft of H, widened by ±G.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from convert import FLIGHTS, load, new_reports
from scipy.optimize import linprog
from scipy.sparse import csr_array

HALF_CELL = 12.5
CLIMB_LIMIT = 150.0
MAX_ACCELERATION = 8.0

Term = tuple[int, float]


class Program:
    """Rows ``|Σ coefficient · variable − value| <= Σ bound``, for `linprog`."""

    def __init__(self) -> None:
        self.entries: list[tuple[int, int, float]] = []
        self.right: list[float] = []

    def within(self, terms: Sequence[Term], value: float, bounds: Sequence[Term], constant: float = 0.0) -> None:
        """|terms − value| <= bounds + constant."""
        for sign in (1.0, -1.0):
            row = len(self.right)
            self.entries += [(row, at, sign * factor) for at, factor in terms]
            self.entries += [(row, at, -factor) for at, factor in bounds]
            self.right.append(sign * value + constant)

    def smallest(self, target: int, limits: Sequence[tuple[float | None, float | None]]) -> float:
        """The smallest value of one variable."""
        rows, columns, values = zip(*self.entries, strict=True)
        matrix = csr_array((values, (rows, columns)), shape=(len(self.right), len(limits)))
        cost = np.zeros(len(limits))
        cost[target] = 1.0
        result = linprog(cost, A_ub=matrix, b_ub=self.right, bounds=limits, method="highs")
        if result.status != 0:
            raise RuntimeError(f"the solver gave up: {result.message}")
        return float(result.fun)


def smallest(reports: Sequence[tuple[int, float]], *, offset: float | None, acceleration: float | None) -> float:
    """The smallest of the two that is None, for a given value of the other."""
    first, last = reports[0][0], reports[-1][0]
    count = last - first + 1
    a, G = 2 * count, 2 * count + 1
    program = Program()
    for k in range(count - 1):
        H, H_next, v, v_next = k, k + 1, count + k, count + k + 1
        rise = [(H_next, 1.0), (H, -1.0)]
        program.within([(v_next, 1.0), (v, -1.0)], 0.0, [(a, 1.0)])
        program.within([*rise, (v, -0.5), (v_next, -0.5)], 0.0, [(a, 0.25)])
        program.within([*rise, (v, -1.0)], 0.0, [(a, 0.5)])
        program.within([*rise, (v_next, -1.0)], 0.0, [(a, 0.5)])
    for second, altitude in reports:
        program.within([(second - first, 1.0)], altitude, [(G, 1.0)], HALF_CELL)
    limits: list[tuple[float | None, float | None]] = [(None, None)] * count + [(-CLIMB_LIMIT, CLIMB_LIMIT)] * count
    limits += [(0.0, None) if value is None else (value, value) for value in (acceleration, offset)]
    return program.smallest(a if acceleration is None else G, limits)


def main(arguments: Sequence[str]) -> int:
    if len(arguments) != 1 or arguments[0] not in FLIGHTS:
        print(f"usage: explain.py {{{'|'.join(FLIGHTS)}}}", file=sys.stderr)
        return 2
    vectors = load(arguments[0])
    reports = [(round(time), altitude) for time, altitude in new_reports(vectors) if altitude is not None]
    repeated = [
        (round(vector["timestamp"] / 1000), vector["altitude"]) for vector in vectors if vector["altitude"] is not None
    ]
    print(f"{arguments[0]}: {len(repeated)} altitudes, {len(reports)} of them new reports; cells of ±{HALF_CELL} ft")
    for name, data in (("all altitudes", repeated), ("new reports", reports)):
        print(f"  {name}, every age 0: explained from |a| <= {smallest(data, offset=0.0, acceleration=None):.1f} ft/s²")
    least = smallest(reports, offset=None, acceleration=MAX_ACCELERATION)
    print(f"  new reports, |a| <= {MAX_ACCELERATION:g} ft/s²: explained from an age offset of ±{least:.1f} ft")
    print(f"  vertical rates change by up to {largest_change(vectors):.0f} ft/min from one second to the next")
    return 0


def largest_change(vectors: Sequence[dict[str, Any]]) -> float:
    """The largest change of the broadcast vertical rate between consecutive seconds, in ft/min."""
    rates = {round(vector["timestamp"] / 1000): vector["vertical_rate"] for vector in vectors}
    known = {time: rate for time, rate in rates.items() if rate is not None}
    return float(max(abs(rate - known[time - 1]) for time, rate in known.items() if time - 1 in known))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
