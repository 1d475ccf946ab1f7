"""Tables I–III of Pavelková & Kárný 2014 beside what is so here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from lsu_mesh.experiments.comparison import Row, compared, ours, stated, table
from lsu_mesh.experiments.outcome import SPREAD, Cell, Column, Spread, Table
from lsu_mesh.experiments.p2014.runs import CORRELATED, KAPPAS, KNOWN, UNCORRELATED, Case, Result

Found = Mapping[tuple[str, Case], Sequence[Result]]
"""The runs by estimator and case."""
POINTS = ("centre", "vertex")
TABLE_I = {
    5: (0.03, 17, 34, 12, 5),
    10: (0.05, 8, 46, 16, 7),
    15: (0.09, 6, 51, 17, 6),
    20: (0.17, 6, 53, 17, 6),
    25: (0.28, 5, 53, 17, 6),
    30: (0.42, 5, 53, 16, 6),
    35: (0.62, 5, 53, 16, 5),
    40: (0.87, 5, 53, 16, 5),
    45: (1.14, 5, 53, 16, 5),
    50: (1.53, 5, 54, 16, 5),
}
"""By Δ: t_c in s, V · 1e3, and N in % for κ = 1, 1.5, 2."""
WELL = "truncated Kalman"
THRICE = "truncated Kalman, variances × 3"
NINEFOLD = "truncated Kalman, half-widths × 3"
KALMAN = {WELL: 1.0, THRICE: 3.0, NINEFOLD: 9.0}
"""By what the variances of the Kalman filters are multiplied; the last two are readings of *three times higher*."""
TABLE_II = {
    "window 5": (0.15, 0.10, 0.06, 0.10, 0.10),
    "window 25": (0.09, 0.07, 0.05, 0.13, 0.11),
    WELL: (0.07, 0.06, 0.05, 0.13, 0.15),
    THRICE: (0.10, 0.11, 0.08, 0.50, 0.51),
    NINEFOLD: (0.10, 0.11, 0.08, 0.50, 0.51),
}
"""Mean absolute errors of three states and two outputs."""
TABLE_III = {
    "window 5": (1.7e-2, 30, 11, 4),
    "window 25": (5.6e-3, 49, 14, 5),
    WELL: (7.1e-7, 67, 9, 1),
    THRICE: (7.1e-4, 10, 1, 0),
    NINEFOLD: (7.1e-4, 10, 1, 0),
}
"""V or V_KF, and N or N_KF in % for κ = 1, 1.5, 2."""
CASES = {CORRELATED: "correlated, E and F estimated", UNCORRELATED: "E = F = I, estimated", KNOWN: "E = F = I, known"}
CONTRADICTORY = "a wrong scale hardly moves the gain, and outputs cannot be five times worse where states are not"
DETERMINANT = "a determinant is no volume; that of the ellipsoid is"
NEAR = 1.5
"""Factor up to which the errors of two estimators are about the same."""


def window(length: int, point: str) -> str:
    """Name of a window estimator."""
    return f"window {length}, {point}"


def performance(found: Found) -> Table:
    """Table I without its times."""
    rows: list[Row] = []
    for length, (_, volume, *outside) in TABLE_I.items():
        for point in POINTS:
            runs = found.get((window(length, point), CORRELATED))
            if runs is not None:
                labels = (str(length), point)
                rows += _size(
                    labels, "V · 1e3", volume, here=[1e3 * run.volume for run in runs], trend=_shrinks(found, length)
                )
                rows += _outside(labels, outside, runs) if point == "centre" else ()
    title = "Table I: correlated noise, E and F estimated, by window length Δ"
    return table("p2014-table-1", title, ["Δ", "point", "quantity"], rows)


def _size(labels: tuple[str, ...], what: str, paper: float, here: list[float], trend: bool) -> Iterator[Row]:
    yield compared((*labels, what), paper, Spread.of(here), trend=trend)


def _shrinks(found: Found, length: int) -> bool:
    """Whether V falls with the window: it does so from Δ = 5 to this one, or from 5 to 25."""
    longer = found[window(25 if length == 5 else length, "centre"), CORRELATED]
    return _mean(longer, "volume") < _mean(found[window(5, "centre"), CORRELATED], "volume")


def _outside(labels: tuple[str, ...], paper: Sequence[float], runs: Sequence[Result]) -> Iterator[Row]:
    """N: a state counts when any of its three coordinates is outside; the paper does not say how it counts."""
    for i, kappa in enumerate(KAPPAS):
        single = np.mean([run.other[i] for run in runs])
        yield compared(
            (*labels, f"N, κ = {kappa:g}, %"), paper[i], Spread.of([run.outside[i] for run in runs]),
            why=f"any of three coordinates counts, of single ones {single:.3g} %",
        )  # fmt: skip


def errors(found: Found) -> Table:
    """Table II: uncorrelated noise."""
    rows: list[Row] = []
    for name, paper in TABLE_II.items():
        for key in _names(name):
            runs = found[key, _case(name)]
            trend, why = _trend(found, name), CONTRADICTORY if name in (THRICE, NINEFOLD) else ""
            for i in range(3):
                here = Spread.of([run.states[i] for run in runs])
                rows.append(compared((key, f"x{i + 1}"), paper[i], here, trend=trend, why=why))
            for i in range(2):
                here = Spread.of([run.fits[i] for run in runs])
                rows.append(compared((key, f"y{i + 1}, fit"), paper[3 + i], here, trend=trend, why=why))
    title = "Table II: mean absolute errors with E = F = I, which the window estimator has to find"
    return table("p2014-table-2", title, ["estimator", "of"], rows)


def _trend(found: Found, name: str) -> bool | None:
    """What the paper concludes: a longer window is better, and about as good as a well set Kalman filter."""
    if name in (THRICE, NINEFOLD):
        return None
    short, long = (_mean(found[window(length, "centre"), UNCORRELATED], "states") for length in (5, 25))
    if name == "window 5":
        return bool(long < short)
    return bool(long < NEAR * _mean(found[WELL, KNOWN], "states"))


def confidence(found: Found) -> Table:
    """Table III: uncorrelated noise."""
    rows: list[Row] = []
    for name, (size, *outside) in TABLE_III.items():
        for key in _names(name):
            runs = found[key, _case(name)]
            if name in KALMAN:
                rows += _ellipsoid(key, size, outside, runs)
            else:
                shrinks = _mean(found[window(25, "centre"), UNCORRELATED], "volume") < _mean(
                    found[window(5, "centre"), UNCORRELATED], "volume"
                )
                rows += _size((key,), "V · 1e3", 1e3 * size, here=[1e3 * run.volume for run in runs], trend=shrinks)
                rows += _outside((key,), outside, runs) if key.endswith("centre") else ()
    rows.append(_growth(found))
    title = "Table III: volumes and shares of states outside, with E = F = I, which the window estimator has to find"
    return table("p2014-table-3", title, ["estimator", "quantity"], rows)


def _ellipsoid(key: str, size: float, outside: Sequence[float], runs: Sequence[Result]) -> Iterator[Row]:
    volume = Spread.of([1e3 * run.ellipsoid for run in runs])
    determinant = Spread.of([1e7 * run.volume for run in runs])
    yield compared(
        (key, "V_KF = mean of det P, · 1e7"), 1e7 * size, determinant, why=f"{DETERMINANT} {1e-3 * volume.mean:.2g}"
    )
    for i, kappa in enumerate(KAPPAS):
        yield compared(
            (key, f"N_KF, κ = {kappa:g}, %"), outside[i], Spread.of([run.outside[i] for run in runs]),
            why="" if kappa == 1.0 else f"{np.mean([run.other[i] for run in runs]):.3g} % with κ²",
        )  # fmt: skip
    yield ours((key, "volume of the ellipsoid with κ = 1, 4/3 π √det P, · 1e3"), volume)


def _growth(found: Found) -> Row:
    """By what the wrong scale multiplies V_KF."""
    well, thrice, ninefold = (_mean(found[name, KNOWN], "volume") for name in KALMAN)
    paper = TABLE_III[THRICE][0] / TABLE_III[WELL][0]
    return stated(
        ("V_KF, incorrect ÷ well set", "factor"), f"{paper:.0f}",
        f"{thrice / well:.3g} with variances × 3, {ninefold / well:.3g} with half-widths × 3",
        holds=abs(ninefold / well - paper) < 0.1 * paper,
        why="without truncation the factors are 27 and 729",
    )  # fmt: skip


def points(found: Found) -> Table:
    """All estimators in all cases, with predictions of outputs that the paper does not have."""
    rows: list[tuple[Cell, ...]] = []
    for (name, case), runs in sorted(found.items(), key=lambda item: (list(CASES).index(item[0][1]), item[0][0])):
        if name.split(",")[0] not in ("window 5", "window 25", WELL):
            continue
        errors = [np.transpose([getattr(run, what) for run in runs]) for what in ("states", "fits", "predictions")]
        rows.append((name, CASES[case], *(Spread.of(values) for column in errors for values in column)))
    titles = ("x1", "x2", "x3", "y1, fit", "y2, fit", "y1, predicted", "y2, predicted")
    columns = (Column("estimator"), Column("noise"), *(Column(f"{title}{SPREAD}") for title in titles))
    return Table(
        "p2014-points", "Mean absolute errors in all cases; *predicted*: before the output is seen", columns, rows
    )


def times(found: Found) -> Table:
    """The times of Table I: measured, so different in every run."""
    rows = []
    for length, (seconds, *_) in TABLE_I.items():
        for point in POINTS:
            runs = found.get((window(length, point), CORRELATED))
            if runs is not None:
                here = Spread.of([1e3 * run.seconds for run in runs])
                rows.append(
                    stated((str(length), point), f"{1e3 * seconds:.0f}", here, holds=here.mean < 1e3 * seconds,
                           why="slower than the paper's")
                )  # fmt: skip
    title = "Table I: t_c, processor time of a step in ms, measured; *reproduced* is not slower than the paper's time"
    return table("p2014-times", title, ["Δ", "point"], rows)


def _names(name: str) -> list[str]:
    return [name] if name in KALMAN else [f"{name}, {point}" for point in POINTS]


def _case(name: str) -> Case:
    return KNOWN if name in KALMAN else UNCORRELATED


def _mean(runs: Sequence[Result], what: str) -> float:
    return float(np.mean([getattr(run, what) for run in runs]))
