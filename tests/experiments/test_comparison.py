"""Verdicts of comparisons with the papers."""

from __future__ import annotations

import math

import pytest

from lsu_mesh.experiments.comparison import compared, count, left_open, ours, stated, table, trend_stated
from lsu_mesh.experiments.outcome import Spread


@pytest.mark.parametrize(
    ("paper", "here", "verdict"),
    [
        (1.0, Spread(1.39, 0.2), "reproduced"),
        (1.0, Spread(1.41, 0.2), "undecided: 1.4 × the paper's"),
        (1.0, Spread(1.59, 0.2), "undecided: 1.6 × the paper's"),
        (1.0, Spread(1.61, 0.2), "deviation: 1.6 × the paper's; noise"),
        (1.0, Spread(1.09, 0.0), "reproduced"),
        (1.0, Spread(0.89, 0.0), "deviation: 0.89 × the paper's; noise"),
        (0.0, Spread(0.5, 0.1), "deviation: 0.5 instead of 0; noise"),
        (-1.0, Spread(-1.05, 0.0), "reproduced"),
    ],
)
def test_a_number_is_reproduced_within_two_deviations_or_a_tenth_and_deviates_beyond_three(
    paper: float, here: Spread, verdict: str
) -> None:
    assert compared(("x",), paper, here, why="noise").verdict == verdict


def test_z_is_the_distance_in_deviations_where_runs_differ_by_more_than_rounding() -> None:
    assert compared(("x",), 1.0, Spread(1.6, 0.2)).z == pytest.approx(3.0)
    assert compared(("x",), 2.0, Spread(1.6, 0.2)).z == pytest.approx(-2.0)
    for here in (Spread(1.6, 0.0), Spread(1.6, 1e-15), Spread(1.6, math.nan), 1.6):
        assert math.isnan(float(compared(("x",), 1.0, here).z))


def test_a_deviation_without_a_reason_says_so() -> None:
    assert compared(("x",), 2.0, 1.0).verdict == "deviation: 0.5 × the paper's; unexplained"
    assert stated(("x",), "large", 1.0, holds=False).verdict == "not reproduced: unexplained"


def test_what_depends_on_something_the_paper_leaves_open_is_undecided() -> None:
    assert left_open(("x",), 2.0, Spread(1.0, 0.1), why="the prior").verdict == "undecided: the prior"
    assert left_open(("x",), 2.0, Spread(2.1, 0.1), why="the prior").verdict == "reproduced"
    assert stated(("x",), "large", 1.0, holds=None, why="the grid").verdict == "undecided: the grid"


def test_statements_in_words() -> None:
    assert stated(("x",), "about 100", 90.0, holds=True, why="not printed").verdict == "reproduced"
    assert stated(("x",), "about 100", 1.0, holds=False, why="B u").verdict == "not reproduced: B u"
    assert trend_stated(("x",), "about 100", 20.0, holds=True, why="less").verdict == "same trend: less"


def test_the_table_and_its_count() -> None:
    rows = [compared(("a",), 1.0, Spread(1.1, 0.25)), ours(("b",), 2.0), stated(("c",), "large", 3.0, holds=False)]
    made = table("t", "A title", ["filter"], rows)
    assert made.markdown().splitlines()[2:] == [
        "| filter | paper | here (mean ± sd) | z | verdict |",
        "| :-- | :-- | --: | --: | :-- |",
        "| a | 1 | 1.1 ± 0.25 | 0.4 | reproduced |",
        "| b | – | 2 | – | – |",
        "| c | large | 3 | – | not reproduced: unexplained |",
    ]
    assert made.csv().splitlines()[:3] == [
        "filter,paper,here,sd,z,verdict", f"a,1.0,1.1,0.25,{(1.1 - 1.0) / 0.25},reproduced", "b,–,2.0,,–,–",
    ]  # fmt: skip
    assert count([made]) == {
        "reproduced": 1, "same trend": 0, "undecided": 0, "deviation": 0, "not reproduced": 1,
    }  # fmt: skip


def test_the_deviation_is_that_of_a_single_run() -> None:
    assert Spread.of([1.0, 3.0]) == Spread(2.0, pytest.approx(2.0**0.5))
    assert Spread.of([0.1, 0.1, 0.1]).sd == 0.0
    assert Spread.of([1.0]).printed(".3g") == "1"
