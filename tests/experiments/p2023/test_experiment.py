"""Tables 1 and 2 of Kuklišová Pavelková 2023, and the numbers to reach."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh.experiments.p2023 import experiment, limits, memory
from lsu_mesh.experiments.p2023.figures import draw_errors
from lsu_mesh.experiments.p2023.runs import CZ_HULL, CZ_NEAREST, NEW_STRIP, Job, errors


@pytest.fixture(scope="module")
def found() -> experiment.Found:
    """Few levels, one run."""
    return {K: [errors(Job(K, 1, 600))] for K in (4.0, 1.0, 0.5, 0.0)}


def test_boxes_and_parallelotopes_reach_the_paper(found: experiment.Found) -> None:
    assert found[0.0][0]["LSUO"].settled == pytest.approx(0.207, rel=0.05)
    assert found[0.5][0]["LSUO"].settled == pytest.approx(0.207 * 10**-0.5, rel=0.06)
    assert found[0.0][0]["LSUP"].settled == pytest.approx(0.180, abs=0.012)


def test_constrained_zonotopes_stay_near_the_state_noise_at_every_level(found: experiment.Found) -> None:
    for K, (run,) in found.items():
        assert run[CZ_HULL].settled <= 1.6e-4, K
        assert run[CZ_NEAREST].settled <= 3e-4, K


def test_nothing_is_outside(found: experiment.Found) -> None:
    assert {name: one.outside for (run,) in found.values() for name, one in run.items() if one.outside} == {}


def test_the_order_of_the_paper_at_high_noise(found: experiment.Found) -> None:
    run = found[0.0][0]
    assert run[CZ_HULL].rmse < run["LSUP"].rmse < run["LSUO"].rmse


def test_a_mean_of_absolute_errors_is_below_the_root_of_the_mean_square(found: experiment.Found) -> None:
    for (run,) in found.values():
        assert all(0.0 < one.mae < one.rmse for one in run.values())
        assert all(one.std == pytest.approx(one.rmse, rel=0.05) for one in run.values())


def test_the_two_rules_for_ties_bracket_the_papers_box(found: experiment.Found) -> None:
    for K in (1.0, 0.5, 0.0):
        old, new = (1e3 * found[K][0][name].rmse for name in ("LSUO", NEW_STRIP))
        assert old < experiment.PAPER_RMSE[K][2] < new, K


def test_the_first_steps_are_the_prior_at_low_noise_and_nothing_at_high_noise(found: experiment.Found) -> None:
    assert found[4.0][0]["LSUO"].early_squares > 50.0
    assert found[0.0][0]["LSUO"].early_squares < 5.0


def test_a_number_of_the_prior_is_undecided_and_the_column_of_lsucz_unexplained() -> None:
    every = {K: [errors(Job(K, 1, 300))] for K in experiment.LEVELS}
    rows = {row.labels: row for row in experiment.rows(every, "rmse", experiment.PAPER_RMSE)}
    assert rows["3.5", CZ_HULL].verdict.startswith("undecided: 9")
    assert rows["0", CZ_HULL].verdict.endswith("; unexplained")
    assert "with the new strip it is 3" in rows["0", "LSUO"].verdict


def test_an_output_hardly_ever_cuts_the_hull_at_high_noise_and_the_prior_is_forgotten() -> None:
    radius, of_sizes = memory.spectral_radii()
    assert (radius, of_sizes) == (pytest.approx(0.568, abs=1e-3), pytest.approx(1.266, abs=1e-3))
    high, low = memory.memory(Job(0.0, 1, 300)), memory.memory(Job(4.0, 1, 300))
    assert high.cuts <= 6
    assert low.cuts > 200
    assert high.with_outputs == pytest.approx(high.without, rel=0.3)
    assert low.with_outputs < 0.8 * low.without


@pytest.mark.parametrize("pair", [(3, 0), (8, 2)])
def test_no_limit_of_complexity_gives_the_papers_column(pair: tuple[int, int]) -> None:
    all_steps, late = limits.errors(limits.Trial(Job(limits.MAX_K, 1, 200), pair, 0.1))
    assert (all_steps < 0.3 * np.array(experiment.PAPER_RMSE[0.0][:2])).all()
    assert (late < 0.6).all()


def test_the_tables_of_the_paper_have_all_levels() -> None:
    assert {4.0, *experiment.PAPER_RMSE} == {4.0, *experiment.PAPER_MAE} == set(experiment.LEVELS)


def test_the_figure_has_a_linear_and_a_logarithmic_axis() -> None:
    curves = {name: list(np.linspace(0.1, 1.0, 3)) for name in experiment.FILTERS}
    linear, logarithmic = draw_errors((4.0, 2.0, 0.0), curves, "RMSE").axes
    assert (linear.get_yscale(), logarithmic.get_yscale()) == ("linear", "log")
    assert [text.get_text() for text in logarithmic.get_legend().get_texts()] == list(experiment.FILTERS)


@pytest.mark.soak
def test_the_whole_paper() -> None:
    assert [str(check) for check in experiment.run().checks if not check.is_met] == []
