"""Kuklišová Pavelková 2023: state estimation on constrained zonotopes, beside boxes and parallelotopes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

from lsu_mesh.experiments.comparison import Row, compared, stated, table
from lsu_mesh.experiments.outcome import Cell, Check, Column, Outcome, Spread, Table, between
from lsu_mesh.experiments.p2023.figures import draw_errors
from lsu_mesh.experiments.p2023.runs import (
    CONSTRAINTS,
    CZ_HULL,
    CZ_NEAREST,
    GENERATORS,
    OMEGA,
    SETTLED,
    START,
    Errors,
    Job,
    errors,
)
from lsu_mesh.experiments.workers import Watch, spread, unwatched

TITLE = "Kuklišová Pavelková (2023): Bayesian state estimation using constrained zonotopes, ICINCO"
LEVELS = (4.0, 3.5, 3.0, 2.5, 2.0, 1.5, 1.0, 0.75, 0.5, 0.25, 0.0)
FILTERS = (CZ_HULL, CZ_NEAREST, "LSUO", "LSUP")
PAPER_RMSE = {
    3.5: (6.0, 6.4, 1.5, 1.6),
    3.0: (6.0, 6.5, 1.4, 2.5),
    2.5: (6.1, 6.6, 1.6, 2.6),
    2.0: (6.4, 7.9, 3.0, 2.9),
    1.5: (7.8, 12.9, 8.4, 6.9),
    1.0: (13.5, 27.5, 26.1, 21.2),
    0.75: (21.5, 50.7, 45.1, 36.7),
    0.5: (27.4, 63.2, 79.1, 57.8),
    0.25: (34.9, 96.1, 139.8, 100.1),
    0.0: (50.3, 141.7, 250.8, 181.5),
}
"""Table 1 by K, in units of 10⁻³; the row K = 4 says "< 10⁻³" four times."""
PAPER_MAE = {
    3.5: (0.5, 0.7, 0.1, 0.1),
    3.0: (0.6, 1.0, 0.3, 0.4),
    2.5: (0.9, 1.8, 0.7, 0.7),
    2.0: (1.9, 3.8, 2.0, 1.9),
    1.5: (3.9, 8.8, 5.9, 4.8),
    1.0: (8.4, 20.4, 18.7, 15.0),
    0.75: (13.4, 35.2, 32.2, 25.1),
    0.5: (17.8, 47.8, 56.9, 39.0),
    0.25: (23.6, 72.2, 99.6, 65.9),
    0.0: (28.7, 102.6, 178.0, 120.0),
}
"""Table 2 by K, in units of 10⁻³."""
LEAST = 1e-3
"""What the row K = 4 of both tables is said to be below, in units of 10⁻³."""
HIGH = 1.0
"""Up to this K the paper's order of filters is compared."""
RUNS, STEPS = 6, 600
QUICK_RUNS, QUICK_STEPS = 1, 300
ERRATA = (
    "(16): `W_{t+1}`; in (5) `f(x_1) = U`, not `x_1 = U`.",
    "Section 4.2 says *highest state noise* where observation noise is meant.",
    (
        "Tables 1 and 2, row K = 4: errors below 10⁻⁶ are impossible with a state noise of 10⁻⁴; probably < 10⁻³ is "
        "meant without the unit of the table."
    ),
    (
        "The column of LSUCZ at large ν is not reproducible from the text: a constrained zonotope of the stated kind "
        "has errors near the state noise for every ν, because outputs of many steps together tell the state."
    ),
)

Found = Mapping[float, Sequence[Mapping[str, Errors]]]


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """Tables 1 and 2, Figures 1–3."""
    runs, steps = (QUICK_RUNS, QUICK_STEPS) if quick else (RUNS, STEPS)
    found = results(range(seed, seed + runs), steps, watch)
    setting = f"{runs} run(s) × {steps} steps"
    tables = [
        table("p2023-table-1", f"Table 1, RMSE × 10³ of the states, {setting}", ["K", "filter"],
              _rows(found, "rmse", PAPER_RMSE)),
        table("p2023-table-2", f"Table 2, MAE × 10³ of the states, {setting}", ["K", "filter"],
              _rows(found, "mae", PAPER_MAE)),
        table("p2023-statements", "What the paper concludes", ["about", "measure"], _statements(found)),
        _settled(found, setting),
    ]  # fmt: skip
    measures = {1: ("rmse", "RMSE"), 2: ("mae", "MAE"), 3: ("std", "STD")}
    return Outcome(
        tables=tables,
        checks=checks(found, 3.0 if quick else 1.0),
        figures={
            f"p2023-figure-{i}": partial(draw_errors, LEVELS, _curves(found, name), label)
            for i, (name, label) in measures.items()
        },
        title=TITLE,
        notes=f"System (15) of P2018 with ω = {OMEGA:g}, ν = 10^−K, {setting} from seed {seed}, u ~ N(0, 1). Neither "
        f"the prior nor the limits of complexity are in the paper: here the box ±{START:g}, from which x_1 is drawn, "
        f"and at most {GENERATORS} generators and {CONSTRAINTS} constraints. RMSE and MAE are over all steps and "
        f"states, as the paper's seem to be; the last table leaves out the first {SETTLED - 1} steps, whose error is "
        "that of the prior.",
        captions={
            f"p2023-figure-{i}": f"Figure {i}. {label} of state estimates over K, ν = 10^−K"
            for i, (_, label) in measures.items()
        },
        errata=ERRATA,
    )


def results(seeds: range, steps: int, watch: Watch = unwatched) -> Found:
    """By K, one mapping per run from filter to errors."""
    jobs = [Job(K, seed, steps) for K in LEVELS for seed in seeds]
    found = spread(errors, jobs, watch)
    return {K: found[i * len(seeds) : (i + 1) * len(seeds)] for i, K in enumerate(LEVELS)}


def _spread_of(found: Found, K: float, name: str, measure: str) -> Spread:
    return Spread.of([1e3 * getattr(one[name], measure) for one in found[K]])


def _rows(found: Found, measure: str, paper: Mapping[float, tuple[float, ...]]) -> Iterator[Row]:
    for K in LEVELS:
        is_ordered = _are_boxes_ordered(found, K, measure)
        for i, name in enumerate(FILTERS):
            here = _spread_of(found, K, name, measure)
            labels = (f"{K:g}", name)
            if K not in paper:
                yield stated(labels, f"< {LEAST:g}", here, holds=here.mean < LEAST, why=_why_least(here))
            else:
                trend = None if name in (CZ_HULL, CZ_NEAREST) else is_ordered
                yield compared(labels, paper[K][i], here, trend=trend, why=_why(K, name))


def _is_ordered(found: Found, K: float, measure: str) -> bool:
    """LSUCZ-1 is the best and LSUO the worst."""
    here = {name: _spread_of(found, K, name, measure).mean for name in FILTERS}
    return min(here, key=here.__getitem__) == CZ_HULL and max(here, key=here.__getitem__) == "LSUO"


def _are_boxes_ordered(found: Found, K: float, measure: str) -> bool:
    """At high noise LSUO is worse than LSUP; at low noise both are about the same."""
    box, body = (_spread_of(found, K, name, measure).mean for name in ("LSUO", "LSUP"))
    return bool(box > body if K <= HIGH else 0.5 < box / body < 2.0)


def _why_least(here: Spread) -> str:
    """Of the row K = 4, which is below the state noise in the unit of its table."""
    without = "without it, < 10⁻³ holds" if here.mean < 1.0 else f"without it, {here.mean:.3g}·10⁻³ is above 10⁻³"
    return f"in the table's unit, 10⁻³, no filter can be below the state noise; {without}"


def _why(K: float, name: str) -> str:
    if name.startswith("LSUCZ"):
        return "outputs of many steps together tell the state"
    return "one run, and another prior" if K > HIGH else "one run in the paper"


def _statements(found: Found) -> Iterator[Row]:
    for measure, label in (("rmse", "RMSE"), ("mae", "MAE"), ("std", "STD")):
        ordered = [_is_ordered(found, K, measure) for K in LEVELS if K <= HIGH]
        words = f"at {sum(ordered)} of {len(ordered)} levels"
        yield stated((f"K ≤ {HIGH:g}", label), "LSUCZ-1 best, LSUO worst", words, holds=all(ordered))
    low = [K for K in LEVELS if K > HIGH]
    ratio = Spread.of(
        [_spread_of(found, K, "LSUO", "settled").mean / _spread_of(found, K, CZ_HULL, "settled").mean for K in low]
    )
    yield stated(
        (f"K > {HIGH:g}, from step {SETTLED} on", "RMSE, LSUO ÷ LSUCZ-1"), "slightly below 1", ratio,
        holds=ratio.mean < 1.0, why="LSUCZ is the best at every noise once the prior is forgotten",
    )  # fmt: skip


def _settled(found: Found, setting: str) -> Table:
    names = list(found[LEVELS[0]][0])
    rows: list[tuple[Cell, ...]] = [
        (f"{K:g}", *(_spread_of(found, K, name, "settled").mean for name in names)) for K in LEVELS
    ]
    columns = (Column("K"), *(Column(name, ".4g") for name in names))
    return Table("p2023-settled", f"RMSE × 10³ from step {SETTLED} on, all filters, {setting}", columns, rows)


def _curves(found: Found, measure: str) -> Mapping[str, list[float]]:
    return {name: [1e-3 * _spread_of(found, K, name, measure).mean for K in LEVELS] for name in FILTERS}


def checks(found: Found, tolerance: float = 1.0) -> list[Check]:
    """The numbers to reach, from step ``SETTLED`` on; ``tolerance`` widens them for few and short runs."""
    worst = max(_spread_of(found, K, CZ_HULL, "settled").mean for K in LEVELS)
    high = [K for K in LEVELS if K <= 0.5]
    shares = [1e-3 * _spread_of(found, K, "LSUO", "settled").mean * 10.0**K for K in high]
    parallelotope = 1e-3 * _spread_of(found, 0.0, "LSUP", "settled").mean
    outside = max(one[name].outside for runs in found.values() for one in runs for name in one)
    near = 0.01 * tolerance
    return [
        Check("p2023: RMSE of LSUCZ-1, worst K", 1e-3 * worst, 1.3e-4 * tolerance),
        Check("p2023: RMSE of LSUO ÷ ν, smallest of K ≤ 0.5", min(shares), 0.207 - near, "at least"),
        Check("p2023: RMSE of LSUO ÷ ν, largest of K ≤ 0.5", max(shares), 0.207 + near),
        *between("p2023: RMSE of LSUP at K = 0", parallelotope, 0.180 - near, 0.180 + near),
        Check("p2023: steps outside, any filter and K", float(outside), 0.0),
    ]
