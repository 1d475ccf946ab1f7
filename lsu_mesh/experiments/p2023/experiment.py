"""Kuklišová Pavelková 2023: state estimation on constrained zonotopes, beside boxes and parallelotopes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from lsu_mesh.array_types import Matrix
from lsu_mesh.experiments.comparison import UNEXPLAINED, Row, compared, left_open, ours, stated, table
from lsu_mesh.experiments.outcome import Cell, Check, Column, Outcome, Spread, Table, between
from lsu_mesh.experiments.p2023 import limits, memory
from lsu_mesh.experiments.p2023.figures import draw_errors
from lsu_mesh.experiments.p2023.memory import Memory
from lsu_mesh.experiments.p2023.runs import (
    CONSTRAINTS,
    CZ_HULL,
    CZ_NEAREST,
    GENERATORS,
    NEW_STRIP,
    OMEGA,
    SETTLED,
    START,
    Errors,
    Job,
    errors,
)
from lsu_mesh.experiments.workers import Watch, part, spread, unwatched

TITLE = "Kuklišová Pavelková (2023): Bayesian state estimation using constrained zonotopes, ICINCO"
LEVELS = (4.0, 3.5, 3.0, 2.5, 2.0, 1.5, 1.0, 0.75, 0.5, 0.25, 0.0)
FILTERS = (CZ_HULL, CZ_NEAREST, "LSUO", "LSUP")
COLUMNS = (CZ_HULL, CZ_NEAREST, "LSUO", NEW_STRIP, "LSUP")
"""What is compared; LSUO of the paper with both rules for ties."""
LOW_NOISE = 2.0
"""From this K on the paper's numbers may be those of the prior."""
TRIED_RUNS = 2
"""Of limits and priors."""
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
HALF = 50.0
"""Per cent of a sum above which a number is that of the first steps."""
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
)

Found = Mapping[float, Sequence[Mapping[str, Errors]]]


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """Tables 1 and 2, Figures 1–3."""
    runs, steps = (QUICK_RUNS, QUICK_STEPS) if quick else (RUNS, STEPS)
    found = results(range(seed, seed + runs), steps, part(watch, 0.0, 0.7))
    remembered = memories(range(seed, seed + runs), steps, part(watch, 0.7, 0.85))
    tried = trials(range(seed, seed + min(runs, TRIED_RUNS)), steps, part(watch, 0.85, 1.0))
    setting = f"{runs} run(s) × {steps} steps"
    tables = [
        table("p2023-table-1", f"Table 1, RMSE × 10³ of the states, {setting}", ["K", "filter"],
              rows(found, "rmse", PAPER_RMSE)),
        table("p2023-table-2", f"Table 2, MAE × 10³ of the states, {setting}", ["K", "filter"],
              rows(found, "mae", PAPER_MAE)),
        table("p2023-statements", "What the paper concludes", ["about", "measure"], _statements(found)),
        _settled(found, setting),
        memory.table(remembered, steps),
        limits.table(tried, PAPER_RMSE[limits.MAX_K]),
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
        notes=_notes(setting, seed),
        captions={
            f"p2023-figure-{i}": f"Figure {i}. {label} of state estimates over K, ν = 10^−K"
            for i, (_, label) in measures.items()
        },
        errata=ERRATA,
    )


def _notes(setting: str, seed: int) -> str:
    return (
        f"System (15) of P2018 with ω = {OMEGA:g}, ν = 10^−K, {setting} from seed {seed}, u ~ N(0, 1). Neither the "
        f"prior nor the limits of complexity are in the paper: here the box ±{START:g}, from which x_1 is drawn, and "
        f"at most {GENERATORS} generators and {CONSTRAINTS} constraints. RMSE and MAE are over all steps and states, "
        f"as the paper's seem to be. For K ≥ {LOW_NOISE:g} a number is *undecided* if more than half of its sum falls "
        f"in the first {SETTLED - 1} steps: it is that of the prior. LSUO is shown with both rules for a strip that "
        "leaves two parallelotopes of equal volume; the paper does not say which it has.\n\n"
        "The column of LSUCZ at large ν is unexplained. The dynamics forget the prior, so a guaranteed set is small "
        "without any output, as the table of cuts shows. Other limits of complexity, down to no constraint at all, and "
        "other priors were tried; the last table has what they give."
    )


def memories(seeds: range, steps: int, watch: Watch = unwatched) -> dict[float, list[Memory]]:
    """What LSUCZ owes to the outputs, by K."""
    jobs = [Job(K, seed, steps) for K in LEVELS for seed in seeds]
    found = spread(memory.memory, jobs, watch)
    return {K: found[i * len(seeds) : (i + 1) * len(seeds)] for i, K in enumerate(LEVELS)}


def trials(seeds: range, steps: int, watch: Watch = unwatched) -> dict[tuple[tuple[int, int], float], Matrix]:
    """RMSE with other limits, and with other priors, as root mean squares over seeds."""
    every = [(pair, START) for pair in limits.LIMITS] + [
        ((GENERATORS, CONSTRAINTS), start) for start in limits.PRIORS if start != START
    ]
    work = [limits.Trial(Job(limits.MAX_K, seed, steps), *one) for one in every for seed in seeds]
    found = spread(limits.errors, work, watch)
    return {
        one: np.sqrt(np.square(found[i * len(seeds) : (i + 1) * len(seeds)]).mean(axis=0))
        for i, one in enumerate(every)
    }


def results(seeds: range, steps: int, watch: Watch = unwatched) -> Found:
    """By K, one mapping per run from filter to errors."""
    jobs = [Job(K, seed, steps) for K in LEVELS for seed in seeds]
    found = spread(errors, jobs, watch)
    return {K: found[i * len(seeds) : (i + 1) * len(seeds)] for i, K in enumerate(LEVELS)}


def _spread_of(found: Found, K: float, name: str, measure: str) -> Spread:
    return Spread.of([1e3 * getattr(one[name], measure) for one in found[K]])


def rows(found: Found, measure: str, paper: Mapping[float, tuple[float, ...]]) -> Iterator[Row]:
    """A paper's table by K and filter; LSUO with both rules for ties."""
    for K in LEVELS:
        for name in COLUMNS:
            here, labels = _spread_of(found, K, name, measure), (f"{K:g}", name)
            if K not in paper:
                yield stated(labels, f"< {LEAST:g}", here, holds=here.mean < LEAST, why=_why_least(found, K, here))
                continue
            number = paper[K][FILTERS.index("LSUO" if name == NEW_STRIP else name)]
            early = _early(found, K, name, measure)
            if K >= LOW_NOISE and early > HALF:
                why = f"{early:.3g} % of our sum fall in the first {SETTLED - 1} steps: it is that of the prior"
                yield left_open(labels, number, here, why=why)
            else:
                yield compared(labels, number, here, why=_why(found, K, name, measure))


def _early(found: Found, K: float, name: str, measure: str) -> float:
    """Share of the first steps in what the measure sums."""
    share = "early_squares" if measure == "rmse" else "early_sizes"
    return float(np.mean([getattr(one[name], share) for one in found[K]]))


def _is_ordered(found: Found, K: float, measure: str) -> bool:
    """LSUCZ-1 is the best and LSUO the worst."""
    here = {name: _spread_of(found, K, name, measure).mean for name in FILTERS}
    return min(here, key=here.__getitem__) == CZ_HULL and max(here, key=here.__getitem__) == "LSUO"


def _why_least(found: Found, K: float, here: Spread) -> str:
    """Of the row K = 4, which is below the state noise in the unit of its table."""
    without = "without it, < 10⁻³ holds" if here.mean < 1.0 else f"without it, {here.mean:.3g}·10⁻³ is above 10⁻³"
    best = min(_spread_of(found, K, name, "settled").mean for name in COLUMNS)
    return f"in the table's unit, 10⁻³, the best filter has {best:.2g} from step {SETTLED} on; {without}"


def _why(found: Found, K: float, name: str, measure: str) -> str:
    """LSUO: what the other rule for ties gives; it is not known what else the papers' numbers have."""
    if name not in ("LSUO", NEW_STRIP):
        return UNEXPLAINED
    other = NEW_STRIP if name == "LSUO" else "LSUO"
    words = "the new strip" if other == NEW_STRIP else "the old edge"
    return f"with {words} it is {_spread_of(found, K, other, measure).mean:.3g}"


def _statements(found: Found) -> Iterator[Row]:
    for measure, label in (("rmse", "RMSE"), ("mae", "MAE"), ("std", "STD")):
        ordered = [_is_ordered(found, K, measure) for K in LEVELS if K <= HIGH]
        words = f"at {sum(ordered)} of {len(ordered)} levels"
        yield stated((f"K ≤ {HIGH:g}", label), "LSUCZ-1 best, LSUO worst", words, holds=all(ordered))
    for K in (K for K in LEVELS if K <= HIGH):
        old, new = (_spread_of(found, K, name, "rmse").mean for name in ("LSUO", NEW_STRIP))
        number = PAPER_RMSE[K][FILTERS.index("LSUO")]
        told = "lies between" if old <= number <= new else "does not lie between"
        yield ours(
            (f"K = {K:g}", "RMSE × 10³ of LSUO, old edge and new strip"),
            f"{old:.4g} and {new:.4g}; the paper's {number:g} {told}",
        )
    low = [K for K in LEVELS if K > HIGH]
    ratio = Spread.of(
        [_spread_of(found, K, "LSUO", "settled").mean / _spread_of(found, K, CZ_HULL, "settled").mean for K in low]
    )
    yield stated(
        (f"K > {HIGH:g}, from step {SETTLED} on", "RMSE, LSUO ÷ LSUCZ-1"), "slightly below 1", ratio,
        holds=ratio.mean < 1.0, why=f"{UNEXPLAINED}; LSUCZ-1 is better at {_better(found, low)} of {len(low)} levels",
    )  # fmt: skip


def _better(found: Found, levels: Sequence[float]) -> int:
    """Levels at which LSUCZ-1 is better than LSUO once the prior is forgotten."""
    return sum(
        _spread_of(found, K, CZ_HULL, "settled").mean < _spread_of(found, K, "LSUO", "settled").mean for K in levels
    )


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
