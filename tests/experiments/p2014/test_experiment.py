"""The numbers of the window estimators and the truncated Kalman filter on the paper's system."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from lsu_mesh.experiments.comparison import VERDICTS
from lsu_mesh.experiments.p2014 import experiment, figures, runs
from lsu_mesh.experiments.p2014.runs import CORRELATED, KNOWN, UNCORRELATED, A, C, F, Job, estimator, result, simulate
from lsu_mesh.experiments.p2014.tables import (
    FITTED_WELL,
    FITTED_WRONG,
    KALMAN,
    TABLE_I,
    TABLE_II,
    TABLE_III,
    THRICE,
    WELL,
)
from lsu_mesh.filters.truncated_kalman import TruncatedKalman
from lsu_mesh.filters.window.window_map import WindowMAP


def test_the_truncated_kalman_filter_has_the_papers_errors() -> None:
    found = result(Job(WELL, KNOWN, 0, "", 1.0, 1, 2500))
    np.testing.assert_allclose(found.states, [0.0694, 0.0511, 0.05], atol=0.004)
    np.testing.assert_allclose(found.fits, [0.125, 0.134], atol=0.008)
    assert (found.predictions > found.fits).all()


def test_three_times_the_variances_cost_little() -> None:
    """Read literally, the paper's row of the incorrect filter is not reproduced."""
    well, wrong = (result(Job(name, KNOWN, 0, "", factor, 1, 1000)) for name, factor in ((WELL, 1.0), (THRICE, 3.0)))
    assert (wrong.states > well.states).any()
    assert (wrong.states < 1.25 * well.states).all()


def test_a_centred_point_has_the_errors_that_were_promised() -> None:
    found = result(Job("", KNOWN, 25, "centre", 1.0, 1, 800))
    assert (found.states <= [0.080, 0.065, 0.053]).all()


def test_the_short_window_has_the_papers_volume_and_errors() -> None:
    found = result(Job("", CORRELATED, 5, "vertex", 1.0, 1, 800))
    assert 1e3 * found.volume == pytest.approx(15.5, abs=4.0)
    np.testing.assert_allclose(found.states, [0.136, 0.094, 0.063], atol=0.015)


def test_tables_two_and_three_are_those_of_an_estimator_that_has_to_find_e_and_f() -> None:
    """With E = F = I known, the volume is a third of the paper's 1.7e-2, and the errors are too small."""
    estimated, known = (result(Job("", case, 5, "centre", 1.0, 1, 1200)) for case in (UNCORRELATED, KNOWN))
    assert estimated.volume == pytest.approx(TABLE_III["window 5"][0], abs=3e-3)
    assert known.volume < 8e-3
    np.testing.assert_allclose(estimated.states, TABLE_II["window 5"][:3], atol=0.02)
    assert known.states[0] < 0.1


def test_a_longer_window_has_smaller_intervals_and_a_centre_beats_a_vertex() -> None:
    vertex, centre = (result(Job("", CORRELATED, 25, point, 1.0, 1, 500)) for point in ("vertex", "centre"))
    assert 1e3 * vertex.volume == pytest.approx(5.84, abs=2.0)
    assert centre.states.sum() < 0.95 * vertex.states.sum()


@pytest.mark.parametrize("factor", [1.0, 9.0])
def test_v_kf_is_the_determinant_of_the_riccati_equation_where_nothing_is_truncated(
    factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, sign in (("LOWER", -1e3), ("UPPER", 1e3)):
        monkeypatch.setattr(runs, name, (sign,) * 3)
    a, c = np.array(A), np.array(C)
    Q, R = factor * 0.1**2 / 3 * np.eye(3), factor * 0.3**2 / 3 * np.eye(2)
    predicted = solve_discrete_are(a.T, c.T, Q, R)
    P = np.linalg.inv(np.linalg.inv(predicted) + c.T @ np.linalg.inv(R) @ c)
    found = result(Job("", KNOWN, 0, "", factor, 1, 1500))
    assert found.volume == pytest.approx(np.linalg.det(P), rel=1e-6)
    assert found.ellipsoid == pytest.approx(4 / 3 * np.pi * np.sqrt(np.linalg.det(P)), rel=1e-6)


@pytest.mark.parametrize("name", [FITTED_WELL, FITTED_WRONG])
def test_the_fitted_variances_have_the_determinants_of_the_paper(name: str) -> None:
    found = 1e7 * runs.untruncated_determinant(KALMAN[name])
    assert found == pytest.approx(1e7 * TABLE_III[name][0], rel=2e-4)
    assert runs.untruncated_determinant(8.0) == pytest.approx(8.0**3 * runs.untruncated_determinant(1.0), rel=1e-9)


def test_the_fitted_incorrect_filter_has_the_papers_errors_of_states_and_not_of_outputs() -> None:
    well, wrong = (result(Job(name, KNOWN, 0, "", KALMAN[name], 1, 2500)) for name in (FITTED_WELL, FITTED_WRONG))
    np.testing.assert_allclose(wrong.states, [0.106, 0.106, 0.086], atol=0.004)
    assert wrong.untruncated == pytest.approx([12.0, 0.0, 0.0], abs=1.5)
    assert well.outside == pytest.approx([68.0, 10.0, 0.1], abs=2.0)
    assert (wrong.fits < 0.5 * np.array(TABLE_II[FITTED_WRONG][3:])).all()


def test_n_kf_counts_what_is_farther_than_kappa() -> None:
    X, Y, U = simulate(False, 3, 120)
    job = Job("", KNOWN, 0, "", 1.0, 3, 120)
    filter = estimator(job)
    assert isinstance(filter, TruncatedKalman)
    far, wider = [], []
    for t in range(121):
        filter.update(Y[t])
        if t > 25:
            error = X[t] - filter.point
            far.append(float(error @ np.linalg.inv(filter.covariance) @ error))
            wider.append(float(error @ np.linalg.inv(filter.untruncated.covariance) @ error))
        if t < 120:
            filter.predict(U[t])
    found = result(job)
    for i, kappa in enumerate((1.0, 1.5, 2.0)):
        assert found.outside[i] == pytest.approx(100 * np.mean([d > kappa**3 for d in far]))
        assert found.untruncated[i] == pytest.approx(100 * np.mean([d > kappa**3 for d in wider]))
        assert found.other[i] == pytest.approx(100 * np.mean([d > kappa**2 for d in far]))


def test_the_intervals_of_figure_2_are_those_of_all_estimates_of_a_state() -> None:
    """(28)–(31) from the estimates themselves: each state is estimated Δ + 1 times while it is in the window."""
    steps, window = 60, figures.INTERVAL_WINDOW
    X, Y, U = simulate(True, 1, steps)
    filter = estimator(Job("", CORRELATED, window, "centre", 1.0, 1, steps))
    assert isinstance(filter, WindowMAP)
    estimates: list[list[float]] = [[] for _ in range(steps + 1)]
    for t in range(steps + 1):
        filter.update(Y[t])
        for age, x in enumerate(filter.states[::-1][: window + 1]):
            if t - age >= 0:
                estimates[t - age].append(float(x[figures.STATE]))
        if t < steps:
            filter.predict(U[t])
    found = figures.traces(1, steps)
    for t in range(1, steps - window + 1):
        smallest, largest = min(estimates[t]), max(estimates[t])
        assert len(estimates[t]) == window + 1
        for i, kappa in enumerate((1.0, 1.5, 2.0)):
            half = kappa * window / (window - 2) * 0.5 * (largest - smallest)
            assert found.lower[t, i] == pytest.approx(0.5 * (smallest + largest) - half, abs=1e-12)
            assert found.upper[t, i] == pytest.approx(0.5 * (smallest + largest) + half, abs=1e-12)
    np.testing.assert_array_equal(found.state, X[:, figures.STATE])


def test_estimates_of_the_parameter_move_around_the_true_value_the_less_the_longer_the_window() -> None:
    found = figures.traces(1)
    settled = {window: values[figures.FIRST :] for window, values in found.parameter.items()}
    assert np.std(settled[25]) < 0.6 * np.std(settled[5])
    assert np.mean(settled[25]) == pytest.approx(F[0][1], abs=0.1)
    assert len(figures.parameter_table(found).rows) == figures.LAST - figures.FIRST + 1
    assert all(np.isfinite(row[2:]).all() for row in figures.interval_table(found).rows)
    for draw in (figures.draw_parameter, figures.draw_intervals):
        axes = draw(found).axes[0]
        assert axes.get_xlabel() == "time t"


def test_a_step_takes_longer_with_more_states() -> None:
    small, large = (figures._timing(n, 25, 1).milliseconds for n in (2, 12))
    assert large > small


def test_every_number_of_the_papers_tables_has_a_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiment, "QUICK_STEPS", 60)
    monkeypatch.setattr(figures, "DIMENSIONS", (2, 4))
    outcome = experiment.run(quick=True)
    tables = {table.name: table for table in outcome.tables}
    given = {name: [float(row[-4]) for row in tables[f"p2014-table-{name}"].rows if row[-1] != "–"] for name in "12"}
    for _, *numbers in TABLE_I.values():
        assert all(given["1"].count(number) >= 1 for number in numbers)
    assert len(given["1"]) == 4 * len(TABLE_I) + 2
    assert given["2"] == [number for name, row in TABLE_II.items() for number in row * (1 if name in KALMAN else 2)]
    third = tables["p2014-table-3"].rows
    papers = [row[-4] for row in third if row[-1] != "–"]
    for size, *outside in TABLE_III.values():
        assert any(size * scale == pytest.approx(paper) for paper in papers for scale in (1e3, 1e7) if paper != "1000")
        assert set(outside) <= set(papers)
    times = [row[2] for row in tables["p2014-times"].rows]
    assert {f"{1e3 * seconds:.0f}" for seconds, *_ in TABLE_I.values()} == set(times)
    for name in ("1", "2", "3"):
        rows = tables[f"p2014-table-{name}"].rows
        assert all(str(row[-1]).startswith((*VERDICTS, "–")) for row in rows)
    assert WELL in {row[0] for row in third}


@pytest.mark.soak
def test_every_number_to_reach_is_reached() -> None:
    outcome = experiment.run()
    assert [str(check) for check in outcome.checks if not check.is_met] == []
