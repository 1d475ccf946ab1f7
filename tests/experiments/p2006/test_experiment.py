"""Half-widths over time against linear programs that are written out here."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from lsu_mesh import systems
from lsu_mesh.experiments.p2006 import experiment
from lsu_mesh.experiments.p2006.figures import PRIOR, SYSTEMS, WINDOW, data_table, draw, trace
from lsu_mesh.simulation import simulate


def smallest_sum(system: str, seed: int, steps: int) -> float:
    """Σ rho + Σ r of the program over a whole record: variables x_1 … x_T, rho (2,), r."""
    model, data = systems.get(system), simulate(systems.get(system), steps, seed)
    assert model.B is not None
    count = 2 * steps + 3
    rows, limits = [], []
    for k in range(steps):
        residuals = [(2 * steps + 2, -model.C[0], None, data.Y[k, 0])]
        if k:
            residuals += [
                (2 * steps + i, np.eye(2)[i], -model.A[i], -model.B[i] @ data.U[k - 1]) for i in range(2)
            ]  # fmt: skip
        for width, now, before, constant in residuals:  # |now x_k + before x_{k−1} + constant| ≤ width
            for sign in (1.0, -1.0):
                row = np.zeros(count)
                row[2 * k : 2 * k + 2] = sign * now
                if before is not None:
                    row[2 * k - 2 : 2 * k] = sign * before
                row[width] = -1.0
                rows.append(row)
                limits.append(-sign * constant)
    lower, upper = PRIOR.bounds()
    box = [*zip(lower, upper, strict=True), *[(None, None)] * (2 * steps - 2), *[(0, None)] * 3]
    cost = np.concatenate([np.zeros(2 * steps), np.ones(3)])
    return float(linprog(cost, np.array(rows), limits, bounds=box, method="highs").fun)


@pytest.mark.parametrize("system", SYSTEMS)
def test_off_line_half_widths_are_the_optimum_of_the_program(system: str) -> None:
    found = trace(system, 3, 40)
    for steps in (2, 10, 40):
        data = simulate(systems.get(system), 40, 3)
        again = simulate(systems.get(system), steps, 3)
        np.testing.assert_array_equal(again.Y, data.Y[:steps])
        assert found.offline[steps - 1].sum() == pytest.approx(smallest_sum(system, 3, steps), abs=1e-6)


@pytest.mark.parametrize("system", SYSTEMS)
def test_more_data_need_no_smaller_half_widths_and_a_window_that_is_not_full_is_the_whole_record(system: str) -> None:
    found = trace(system, 3, 60)
    sums = found.offline[1:].sum(axis=1)
    assert (np.diff(sums) > -1e-7).all()
    np.testing.assert_allclose(found.online[1 : WINDOW + 1].sum(axis=1), sums[:WINDOW], atol=1e-6)
    assert (found.online[1:].sum(axis=1) <= found.true.sum() + 1e-7).all()


def test_the_figures_show_the_data_and_the_simulated_half_widths() -> None:
    traces = [trace(system, 1, 30) for system in SYSTEMS]
    for is_online in (False, True):
        figure = draw(traces, is_online)
        assert len(figure.axes) == 4
        for axes, index in zip(figure.axes, (0, 1, 0, 1), strict=True):
            values = traces[index].online if is_online else traces[index].offline
            columns = [values[:, :2], values[:, 2:]][axes.get_ylabel() == "half-width of output noise"]
            drawn = [line.get_ydata() for line in axes.get_lines()]
            np.testing.assert_array_equal(np.column_stack(drawn[:-1]), columns)
            assert set(np.asarray(drawn[-1], dtype=float)) == {0.1}
    assert len(data_table(traces).rows) == 60


def test_the_experiment_tells_a_verdict_in_every_row() -> None:
    outcome = experiment.run(quick=True)
    assert all(check.is_met for check in outcome.checks)
    statements = outcome.tables[1].rows
    assert [str(row[-1]).split(":")[0] for row in statements] == ["reproduced", "reproduced", "undecided"]
    assert set(outcome.figures) == set(outcome.captions)
