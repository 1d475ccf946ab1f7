"""Table 1 of Pavelková & Jirsa 2018: the statistics against their definitions, and the numbers to reach."""

from __future__ import annotations

import statistics

import numpy as np
import pytest

from lsu_mesh.experiments.effect import Effect
from lsu_mesh.experiments.p2018 import experiment, noise
from lsu_mesh.experiments.p2018.figures import (
    FIRST,
    LAST,
    draw_states,
    draw_times,
    exponent,
    states,
    states_table,
    timings,
)
from lsu_mesh.experiments.p2018.runs import (
    ESTIMATORS,
    NEW_STRIP,
    OLD_EDGE,
    STATISTICS,
    Job,
    Result,
    data_of,
    prior,
    result,
)
from lsu_mesh.experiments.p2018.runs import statistics as rows_of
from lsu_mesh.experiments.p2018.table_1 import comparison, spread_of, ties
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.simulation import Simulation


def test_the_statistics_are_those_of_the_table() -> None:
    truth = np.zeros((5, 3))
    truth[:, 1] = [0.0, 0.1, -0.2, 0.3, 1.0]
    outputs = np.arange(10.0).reshape(5, 2)
    data = Simulation(truth, np.ones((5, 2)), np.zeros((5, 1)))
    points, lower, upper = np.zeros((5, 3)), np.full((5, 3), -0.5), np.full((5, 3), 0.5)
    values = dict(zip(STATISTICS, rows_of(points, lower, upper, outputs, data), strict=True))
    errors = [-float(x) for x in truth[:, 1]]
    assert values["Σ (x̂₂ − x₂)²"] == pytest.approx(sum(e * e for e in errors))
    assert values["median (x̂₂ − x₂)"] == pytest.approx(statistics.median(errors))
    assert values["std (x̂₂ − x₂)"] == pytest.approx(statistics.stdev(errors))
    assert values["median (ŷ₂ − y₂)"] == 4.0
    assert values["std (ŷ₁ − y₁)"] == pytest.approx(statistics.stdev([-1.0, 1.0, 3.0, 5.0, 7.0]))
    assert values["median half-width of x₂"] == 0.5
    assert values["x₂ outside, %"] == 20.0


def test_the_numbers_to_reach() -> None:
    names = [name for name in ESTIMATORS if name.startswith(("LSUO", "ZKF"))]
    found = {name: [result(Job(name, seed)) for seed in range(1, 13)] for name in names}
    assert [str(check) for check in experiment.checks(found) if not check.is_met] == []
    half_widths = [one.statistics[STATISTICS.index("median half-width of x₂")] for one in found["ZKF q=15, predictor"]]
    assert half_widths == pytest.approx([0.408] * 12, abs=5e-4)


def test_window_map_is_the_only_one_that_loses_states() -> None:
    outside = {name: result(Job(name, 1, 60)).statistics[-1] for name in ESTIMATORS}
    assert {name for name, share in outside.items() if share > 0} <= {"WindowMAP, vertex", "WindowMAP, centre"}
    assert {name for name, estimator in ESTIMATORS.items() if not estimator.is_guaranteed} == {
        "WindowMAP, vertex",
        "WindowMAP, centre",
    }


def test_an_effect_is_the_factor_between_the_ends() -> None:
    grid = np.outer([1.0, 5.0, 3.0], [1.0, 2.0])
    assert Effect.of(grid) == pytest.approx((3.0, 2.0))
    assert str(Effect(3.0, 2.0)) == "× 3 by ρ, × 2 by r"
    assert Effect.difference(grid) == pytest.approx((3.0, 3.0))


def test_which_noise_matters_more_depends_on_the_rule_for_ties() -> None:
    grids = {(ties, noise.LEVELS): noise.errors(1, 3, noise.LEVELS, ties) for ties in ("old", "new")}
    first, *readings = noise.what_matters(grids)
    assert first.verdict.startswith("undecided: ")
    assert first.here == "in 0 of 2 readings with the old edge, in 2 of 2 readings with the new strip"
    assert [row.labels[0] for row in readings] == [
        "Figure 2, 0.05 to 0.5, old edge",
        "Figure 2, 0.05 to 0.5, new strip",
    ]


@pytest.fixture(scope="module")
def few() -> dict[str, list[Result]]:
    """Six runs with each rule for ties."""
    return {name: [result(Job(name, seed)) for seed in range(1, 7)] for name in (OLD_EDGE, NEW_STRIP)}


def test_keeping_the_old_edge_cuts_the_error_by_a_third(few: dict[str, list[Result]]) -> None:
    rows = {row[0]: row for row in ties(few).rows}
    assert rows["RMSE of x₂"][-1].mean == pytest.approx(0.71, abs=0.05)
    assert rows["RMSE of all states"][-1].mean < 0.95
    assert rows["Σ (x̂₂ − x₂)²"][1:4] == (
        1.77,
        spread_of(few[OLD_EDGE], STATISTICS[0]),
        spread_of(few[NEW_STRIP], STATISTICS[0]),
    )
    assert rows["residual of y₁ is 0, % of steps"][3].mean > 95.0


def test_a_deviation_names_the_other_rule_where_that_is_nearer(few: dict[str, list[Result]]) -> None:
    rows = {row.labels: row for row in comparison(few)}
    assert "; with the new strip 2." in rows[OLD_EDGE, "Σ (x̂₂ − x₂)²"].verdict
    assert rows[NEW_STRIP, "std (ŷ₂ − y₂)"].verdict == "reproduced"
    assert float(rows[OLD_EDGE, "std (ŷ₂ − y₂)"].z) > 3.0
    assert " % of the steps here" in rows[OLD_EDGE, "median (ŷ₂ − y₂)"].verdict


def test_what_is_on_the_data_is_counted() -> None:
    found = result(Job(NEW_STRIP, 1, 60))
    assert found.on_the_data[0] > found.on_the_data[1] > 20.0
    assert found.rmse > 0.0


def test_errors_grow_with_both_noises() -> None:
    effect = Effect.of(noise.errors(1, 2).values)
    assert min(effect) > 1.5


def test_figure_1_shows_the_steps_of_a_filter_that_goes_one_by_one() -> None:
    found = states(1)
    model, data = data_of(1, LAST)
    filter = LSUO(model, prior(model), meet=False, point="centre")
    for k in range(LAST):
        filter.update(data.Y[k])
        if k + 1 >= FIRST:
            lower, upper = filter.bounds()
            row = k + 1 - FIRST
            for values, shown in ((data.X[k], found.simulated), (filter.point, found.estimated)):
                np.testing.assert_array_equal(shown[row], values)
            np.testing.assert_array_equal([found.lower[row], found.upper[row]], [lower, upper])
            assert (lower <= data.X[k]).all()
            assert (data.X[k] <= upper).all()
            assert states_table(found).rows[row][:2] == (k + 1, data.X[k, 0])
        if k + 1 < LAST:
            filter.predict(data.U[k])


def test_the_figures_are_named() -> None:
    drawn = draw_states(states(1))
    assert [axes.get_ylabel() for axes in drawn.axes] == ["$x_{t,1}$", "$x_{t,2}$", "$x_{t,3}$"]
    times = timings(1)
    axes = draw_times(times).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("number of states", "µs per step")
    assert 0.0 < exponent(times) < 3.0
