"""Table 1 of Pavelková & Jirsa 2018 beside ours, and what the rule for ties of the strip update does to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from lsu_mesh.experiments.comparison import UNEXPLAINED, Row, compared, stated
from lsu_mesh.experiments.outcome import SPREAD, Cell, Column, Spread, Table
from lsu_mesh.experiments.p2018.runs import ESTIMATORS, NEW_STRIP, OLD_EDGE, STATISTICS, STEPS, Result

Found = Mapping[str, Sequence[Result]]
"""The runs by estimator."""
PAPER: Mapping[str, tuple[float, ...]] = {
    "LSU": (1.770, 0.034, 0.133, 1e-18, 1e-16, -0.007, 0.054, 0.360, 0.053, 0.0),
    "WIN": (11.810, -0.058, 0.399, 0.032, 0.197, -0.069, 0.404, 0.464, 0.303, 9.6),
    "ZKF q=15": (1.980, 0.001, 0.141, 0.022, 0.221, -0.031, 0.222, 0.408, 0.028, 0.0),
    "ZKF q=3": (4.810, -0.015, 0.220, -0.011, 0.206, -0.040, 0.312, 0.385, 0.023, 7.0),
}
"""In the order of ``STATISTICS``."""
EXACT = 1e-12
"""Below it a residual counts as what the paper prints as 10⁻¹⁸."""


def spread_of(found: Sequence[Result], statistic: str) -> Spread:
    """Mean and deviation of a row of the table over runs."""
    return Spread.of([one.statistics[STATISTICS.index(statistic)] for one in found])


def comparison(found: Found) -> Iterator[Row]:
    """The table's columns one below the other."""
    for name in found:
        column = ESTIMATORS[name].column
        for i, statistic in enumerate(STATISTICS if column else ()):
            here, paper = spread_of(found[name], statistic), PAPER[column][i]
            why = _why(found, name, statistic)
            if 0.0 < abs(paper) < EXACT:
                yield stated((name, statistic), f"{paper:.0e}", here, holds=abs(here.mean) < EXACT, why=why)
            else:
                yield compared((name, statistic), paper, here, why=why)


def _why(found: Found, name: str, statistic: str) -> str:
    """What the runs tell of a deviation: how the other rule for ties does, and where the residual is 0."""
    if name not in (OLD_EDGE, NEW_STRIP):
        return UNEXPLAINED
    if "ŷ" in statistic:
        output = 0 if "ŷ₁" in statistic else 1
        shares = {rule: _on_the_data(found[rule], output).mean for rule in (OLD_EDGE, NEW_STRIP)}
        told = f"the residual is 0 in {shares[name]:.3g} % of the steps here"
        return told if statistic.startswith("median") else f"{told}{_other_rule(found, name, statistic)}"
    return _other_rule(found, name, statistic).removeprefix("; ") or UNEXPLAINED


def _other_rule(found: Found, name: str, statistic: str) -> str:
    """The number with the other rule, where it is nearer to the paper's."""
    paper = PAPER["LSU"][STATISTICS.index(statistic)]
    other = NEW_STRIP if name == OLD_EDGE else OLD_EDGE
    here, there = spread_of(found[name], statistic), spread_of(found[other], statistic)
    words = "with the new strip" if other == NEW_STRIP else "with the old edge"
    z = f" (z = {(there.mean - paper) / there.sd:.2g})" if there.sd > 0.0 else ""
    return f"; {words} {there.mean:.3g}{z}" if abs(there.mean - paper) < abs(here.mean - paper) else ""


def _on_the_data(found: Sequence[Result], output: int) -> Spread:
    return Spread.of([one.on_the_data[output] for one in found])


def ties(found: Found) -> Table:
    """Both rules side by side, with the error of all states."""
    rows: list[tuple[Cell, ...]] = []
    for i, statistic in enumerate(STATISTICS):
        old, new = (spread_of(found[rule], statistic) for rule in (OLD_EDGE, NEW_STRIP))
        rows.append((statistic, PAPER["LSU"][i], old, new, _ratio(old, new)))
    for output in (0, 1):
        old, new = (_on_the_data(found[rule], output) for rule in (OLD_EDGE, NEW_STRIP))
        rows.append((f"residual of y{'₁₂'[output]} is 0, % of steps", "–", old, new, _ratio(old, new)))
    errors = {
        rule: {
            "RMSE of x₂": [(one.statistics[0] / STEPS) ** 0.5 for one in runs],
            "RMSE of all states": [one.rmse for one in runs],
        }
        for rule, runs in found.items()
        if rule in (OLD_EDGE, NEW_STRIP)
    }
    for name in errors[OLD_EDGE]:
        both = (errors[OLD_EDGE][name], errors[NEW_STRIP][name])
        ratios = [a / b for a, b in zip(*both, strict=True)]
        rows.append((name, "–", *map(Spread.of, both), Spread.of(ratios)))
    columns = (
        Column("quantity"), Column("paper", ".4g"), Column(f"old edge{SPREAD}"), Column(f"new strip{SPREAD}"),
        Column(f"old ÷ new{SPREAD}"),
    )  # fmt: skip
    title = "LSUO of the paper with both rules for a strip that leaves two parallelotopes of equal volume"
    return Table("p2018-ties", title, columns, rows)


def _ratio(old: Spread, new: Spread) -> Cell:
    return old.mean / new.mean if min(abs(old.mean), abs(new.mean)) > EXACT else "–"
