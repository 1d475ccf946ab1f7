"""What Pavelková & Jirsa 2018 say of Table 1 (section 4.3), beside what is so here."""

from __future__ import annotations

from collections.abc import Iterator

from lsu_mesh.experiments.comparison import Row, stated, trend_stated
from lsu_mesh.experiments.p2018.runs import ESTIMATORS, NEW_STRIP, OLD_EDGE, STATISTICS
from lsu_mesh.experiments.p2018.table_1 import PAPER, Found, spread_of

SQUARES, PREDICTED, HALF_WIDTH, OUTSIDE = STATISTICS[0], STATISTICS[6], STATISTICS[7], STATISTICS[9]
ZKF, SMALL_ZKF, WINDOW = "ZKF q=15, predictor", "ZKF q=3, predictor", "WindowMAP, vertex"
ABOUT = 2.0
"""Factor up to which two sums of squares are comparable."""


def statements(found: Found) -> Iterator[Row]:
    """One row per statement; those of LSU for both rules for ties."""
    mean = {(name, what): spread_of(found[name], what).mean for name in ESTIMATORS for what in STATISTICS}
    errors = {name: mean[name, SQUARES] for name in (OLD_EDGE, NEW_STRIP, WINDOW, ZKF, SMALL_ZKF)}
    for name in (OLD_EDGE, NEW_STRIP):
        ratio = errors[name] / errors[ZKF]
        yield stated((f"{name} ÷ ZKF q=15", SQUARES), "comparable", ratio, holds=1.0 / ABOUT < ratio < ABOUT)
    for name in (OLD_EDGE, NEW_STRIP):
        ratio = mean[name, PREDICTED] / min(mean[ZKF, PREDICTED], mean[SMALL_ZKF, PREDICTED])
        yield stated((f"{name} ÷ the better ZKF", PREDICTED), "predicts best", ratio, holds=ratio < 1.0)
    ratio, paper = errors[SMALL_ZKF] / errors[ZKF], PAPER["ZKF q=3"][0] / PAPER["ZKF q=15"][0]
    yield trend_stated(
        ("ZKF q=3 ÷ q=15", SQUARES), f"higher, {paper:.2g}", ratio, holds=ratio > 1.0, why="the factor is smaller here"
    )
    ratio = mean[SMALL_ZKF, HALF_WIDTH] / mean[ZKF, HALF_WIDTH]
    yield stated(("ZKF q=3 ÷ q=15", HALF_WIDTH), "tighter", ratio, holds=ratio < 1.0)
    yield stated(("ZKF q=3", OUTSIDE), "some", mean[SMALL_ZKF, OUTSIDE], holds=mean[SMALL_ZKF, OUTSIDE] > 0.0)
    worst = max(errors, key=errors.__getitem__)
    yield stated(("WIN", SQUARES), "the greatest", errors[WINDOW], holds=worst == WINDOW,
                 why=f"{worst} has {errors[worst]:.3g}")  # fmt: skip
    lost = mean[WINDOW, OUTSIDE]
    yield stated(("WIN", OUTSIDE), "the most", lost, holds=lost > max(mean[name, OUTSIDE] for name in (OLD_EDGE, ZKF)))
