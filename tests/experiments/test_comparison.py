"""Verdicts of comparisons with the papers."""

from __future__ import annotations

import pytest

from lsu_mesh.experiments.comparison import compared, count, ours, stated, table, trend_stated
from lsu_mesh.experiments.outcome import Spread


@pytest.mark.parametrize(
    ("paper", "here", "verdict"),
    [
        (1.0, Spread(1.39, 0.2), "reproduced"),
        (1.0, Spread(1.41, 0.2), "not reproduced: 1.4 × the paper's; noise"),
        (1.0, Spread(1.09, 0.0), "reproduced"),
        (1.0, Spread(0.89, 0.0), "not reproduced: 0.89 × the paper's; noise"),
        (0.0, Spread(0.5, 0.1), "not reproduced: 0.5 instead of 0; noise"),
        (-1.0, Spread(-1.05, 0.0), "reproduced"),
    ],
)
def test_a_number_is_reproduced_within_two_deviations_or_a_tenth(paper: float, here: Spread, verdict: str) -> None:
    assert compared(("x",), paper, here, why="noise").verdict == verdict


def test_a_trend_that_holds_is_said_with_the_size() -> None:
    assert compared(("x",), 2.0, 1.0, trend=True, why="one run").verdict == "same trend: 0.5 × the paper's; one run"
    assert compared(("x",), 2.0, 1.0, trend=False).verdict == "not reproduced: 0.5 × the paper's"


def test_statements_in_words() -> None:
    assert stated(("x",), "about 100", 90.0, holds=True, why="not printed").verdict == "reproduced"
    assert stated(("x",), "about 100", 1.0, holds=False, why="B u").verdict == "not reproduced: B u"
    assert trend_stated(("x",), "about 100", 20.0, holds=True, why="less").verdict == "same trend: less"


def test_the_table_and_its_count() -> None:
    rows = [compared(("a",), 1.0, Spread(1.0, 0.25)), ours(("b",), 2.0), stated(("c",), "large", 3.0, holds=False)]
    made = table("t", "A title", ["filter"], rows)
    assert made.markdown().splitlines()[2:] == [
        "| filter | paper | here (mean ± sd) | verdict |",
        "| :-- | :-- | --: | :-- |",
        "| a | 1 | 1 ± 0.25 | reproduced |",
        "| b | – | 2 | – |",
        "| c | large | 3 | not reproduced: it does not hold here |",
    ]
    assert made.csv().splitlines()[:3] == ["filter,paper,here,sd,verdict", "a,1.0,1.0,0.25,reproduced", "b,–,2.0,,–"]
    assert count([made]) == {"reproduced": 1, "same trend": 0, "not reproduced": 1}


def test_the_deviation_is_that_of_a_single_run() -> None:
    assert Spread.of([1.0, 3.0]) == Spread(2.0, pytest.approx(2.0**0.5))
    assert Spread.of([0.1, 0.1, 0.1]).sd == 0.0
    assert Spread.of([1.0]).printed(".3g") == "1"
