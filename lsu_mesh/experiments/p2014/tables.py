"""Tables I–III of Pavelková & Kárný 2014 beside what is so here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from lsu_mesh.experiments.comparison import UNEXPLAINED, Row, compared, ours, stated, table, trend_stated
from lsu_mesh.experiments.outcome import SPREAD, Cell, Column, Spread, Table
from lsu_mesh.experiments.p2014.runs import (
    CORRELATED,
    KAPPAS,
    KNOWN,
    UNCORRELATED,
    Case,
    Result,
    untruncated_determinant,
)

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
FITTED_WELL = "truncated Kalman, fitted: variances 2 h²/3"
FITTED_WRONG = "truncated Kalman, fitted: variances 20 h²/3"
KALMAN = {WELL: 1.0, THRICE: 3.0, NINEFOLD: 9.0, FITTED_WELL: 2.0, FITTED_WRONG: 20.0}
"""By what the variances h²/3 of the Kalman filters are multiplied. THRICE and NINEFOLD are readings of *three times
higher*. The fitted ones were found from the two values of V_KF in Table III: det P goes with the cube of the factor."""
NEARER = {WELL: FITTED_WELL, THRICE: FITTED_WRONG, NINEFOLD: FITTED_WRONG}
"""The fitted reading of each literal one."""
TABLE_II = {
    "window 5": (0.15, 0.10, 0.06, 0.10, 0.10),
    "window 25": (0.09, 0.07, 0.05, 0.13, 0.11),
    WELL: (0.07, 0.06, 0.05, 0.13, 0.15),
    THRICE: (0.10, 0.11, 0.08, 0.50, 0.51),
    NINEFOLD: (0.10, 0.11, 0.08, 0.50, 0.51),
    FITTED_WELL: (0.07, 0.06, 0.05, 0.13, 0.15),
    FITTED_WRONG: (0.10, 0.11, 0.08, 0.50, 0.51),
}
"""Mean absolute errors of three states and two outputs."""
TABLE_III = {
    "window 5": (1.7e-2, 30, 11, 4),
    "window 25": (5.6e-3, 49, 14, 5),
    WELL: (7.1e-7, 67, 9, 1),
    THRICE: (7.1e-4, 10, 1, 0),
    NINEFOLD: (7.1e-4, 10, 1, 0),
    FITTED_WELL: (7.1e-7, 67, 9, 1),
    FITTED_WRONG: (7.1e-4, 10, 1, 0),
}
"""V or V_KF, and N or N_KF in % for κ = 1, 1.5, 2."""
CASES = {CORRELATED: "correlated, E and F estimated", UNCORRELATED: "E = F = I, estimated", KNOWN: "E = F = I, known"}
SATURATED = 1.25
"""Factor up to which a longer window has changed nothing."""
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
                here = Spread.of([1e3 * run.volume for run in runs])
                rows.append(compared((*labels, "V · 1e3"), volume, here))
                rows += _outside(labels, outside, runs) if point == "centre" else ()
    title = "Table I: correlated noise, E and F estimated, by window length Δ"
    return table("p2014-table-1", title, ["Δ", "point", "quantity"], rows)


def _outside(labels: tuple[str, ...], paper: Sequence[float], runs: Sequence[Result]) -> Iterator[Row]:
    """N: a state counts when any of its three coordinates is outside; the paper does not say how it counts."""
    for i, kappa in enumerate(KAPPAS):
        single = np.mean([run.other[i] for run in runs])
        yield compared(
            (*labels, f"N, κ = {kappa:g}, %"), paper[i], Spread.of([run.outside[i] for run in runs]),
            why=f"unexplained; of single coordinates {single:.3g} %",
        )  # fmt: skip


def errors(found: Found) -> Table:
    """Table II: uncorrelated noise."""
    rows: list[Row] = []
    for name, paper in TABLE_II.items():
        for key in _names(name):
            runs = found[key, _case(name)]
            labels = [f"x{i + 1}" for i in range(3)] + [f"y{i + 1}, fit" for i in range(2)]
            for i, label in enumerate(labels):
                here = _errors(runs, i)
                rows.append(compared((key, label), paper[i], here, why=_fitted_error(found, name, i)))
    title = "Table II: mean absolute errors with E = F = I, which the window estimator has to find"
    return table("p2014-table-2", title, ["estimator", "of"], rows)


def _errors(runs: Sequence[Result], i: int) -> Spread:
    """Of state i, or of output i − 3."""
    return Spread.of([(*run.states, *run.fits)[i] for run in runs])


def _fitted_error(found: Found, name: str, i: int) -> str:
    """What the fitted reading gives for a state; the outputs it explains no better."""
    if name not in NEARER or i >= 3:
        return UNEXPLAINED
    return f"the fitted variances give {_errors(found[NEARER[name], KNOWN], i).mean:.3g}"


def confidence(found: Found) -> Table:
    """Table III: uncorrelated noise."""
    rows: list[Row] = []
    for name, (size, *outside) in TABLE_III.items():
        for key in _names(name):
            runs = found[key, _case(name)]
            if name in KALMAN:
                rows += _ellipsoid(key, size, outside, runs)
            else:
                here = Spread.of([1e3 * run.volume for run in runs])
                rows.append(compared((key, "V · 1e3"), 1e3 * size, here))
                rows += _outside((key,), outside, runs) if key.endswith("centre") else ()
    title = "Table III: volumes and shares of states outside, with E = F = I, which the window estimator has to find"
    return table("p2014-table-3", title, ["estimator", "quantity"], rows)


def _ellipsoid(key: str, size: float, outside: Sequence[float], runs: Sequence[Result]) -> Iterator[Row]:
    literal, fitted = Spread.of([1e7 * run.volume for run in runs]), 1e7 * untruncated_determinant(KALMAN[key])
    near = 1e7 * untruncated_determinant(KALMAN[NEARER.get(key, key)])
    why = f"the fitted variances give {near:.4g} without truncation"
    if key in NEARER:
        yield compared((key, "V_KF = mean of det P, · 1e7"), 1e7 * size, literal, why=why)
        yield ours((key, "det P without truncation, · 1e7"), fitted)
    else:
        yield compared((key, "V_KF = det P without truncation, · 1e7"), 1e7 * size, fitted)
        yield ours((key, "mean of det P, · 1e7"), literal)
    for i, kappa in enumerate(KAPPAS):
        squared = "" if kappa == 1.0 else f"; {np.mean([run.other[i] for run in runs]):.3g} % with κ²"
        here, wider = (Spread.of([getattr(run, what)[i] for run in runs]) for what in ("outside", "untruncated"))
        yield compared((key, f"N_KF, κ = {kappa:g}, %"), outside[i], here, why=f"{UNEXPLAINED}{squared}")
        if key not in NEARER:
            yield compared((key, f"N_KF, κ = {kappa:g}, P before its truncation, %"), outside[i], wider)
    volume = Spread.of([1e3 * run.ellipsoid for run in runs])
    yield ours((key, "volume of the ellipsoid with κ = 1, 4/3 π √det P, · 1e3"), volume)


def statements(found: Found) -> Table:
    """What section 6 concludes, in direction."""
    rows: list[Row] = []
    for case in (CORRELATED, UNCORRELATED):
        short, long = (found[window(length, "centre"), case] for length in (5, 25))
        for what, label in (("volume", "V"), ("states", "errors of the states, mean")):
            ratio = _mean(long, what) / _mean(short, what)
            rows.append(stated((f"Δ = 25 ÷ Δ = 5, {CASES[case]}", label), "smaller", ratio, holds=ratio < 1.0))
    longest = [found[window(length, "centre"), CORRELATED] for length in (25, 50)]
    for what, label in (("volume", "V"), ("states", "errors of the states, mean")):
        ratio = _mean(longest[1], what) / _mean(longest[0], what)
        rows.append(
            stated(("Δ = 50 ÷ Δ = 25", label), "about the same", ratio, holds=1.0 / SATURATED < ratio < SATURATED)
        )
    ratio = _mean(found[window(25, "centre"), UNCORRELATED], "states") / _mean(found[WELL, KNOWN], "states")
    rows.append(
        stated(("Δ = 25 ÷ well set Kalman", "errors of the states, mean"), "about the same", ratio, holds=ratio < NEAR)
    )
    for name in (THRICE, NINEFOLD, FITTED_WRONG):
        ratio = _mean(found[name, KNOWN], "states") / _mean(found[WELL, KNOWN], "states")
        rows.append(stated((f"{name} ÷ well set", "errors of the states, mean"), "worse", ratio, holds=ratio > 1.0))
        ratio = _mean(found[name, KNOWN], "fits") / _mean(found[WELL, KNOWN], "fits")
        rows.append(
            trend_stated(
                (f"{name} ÷ well set", "errors of the outputs, mean"), "3.6 times", ratio, holds=ratio > 1.0,
                why=UNEXPLAINED,
            )
        )  # fmt: skip
    return table("p2014-statements", "What the paper concludes (section 6.4)", ["about", "quantity"], rows)


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
