"""Fusion and transfer at the numbers to reach: ALGORITHMS' rows of P3, and transfer against the source's noise."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from lsu_mesh.experiments import fusion, transfer
from lsu_mesh.experiments.outcome import Outcome

SEEDS, STEPS = range(11, 14), 60
TRANSFER_STEPS = 100
"""As many as in the experiment: a mean width over fewer steps may exceed the isolated one by chance."""


@cache
def tally(kind: str, feedback: str) -> fusion.Tally:
    return fusion.tally(kind, feedback, SEEDS, STEPS)


@cache
def result(system: str, kind: str, way: str, ratio: float) -> transfer.Result:
    return transfer.result(system, kind, way, ratio, range(21, 24), TRANSFER_STEPS)


PAIRS = [
    (system, kind) for system, kinds in transfer.SYSTEMS.items() for kind in kinds if kind not in transfer.BY_VOLUME
]


@pytest.mark.parametrize("feedback", fusion.FEEDBACKS)
@pytest.mark.parametrize("kind", fusion.KINDS)
def test_every_set_holds_the_truth_at_every_step(kind: str, feedback: str) -> None:
    counts = tally(kind, feedback)
    assert len(counts.held) == len(SEEDS) * STEPS
    assert all(counts.held)


def test_fused_parallelotopes_are_at_most_half_of_the_best_local_one() -> None:
    ratios = tally("LSUP image", "none").ratios
    assert len(ratios) >= 30
    assert np.mean(ratios) <= 0.5


def test_with_the_fused_box_fed_back_every_constrained_zonotope_is_small() -> None:
    local = np.mean(tally("LSUCZ", "same step").local, axis=0)
    assert (local <= 0.09).all()
    assert (np.mean(tally("LSUCZ", "none").local, axis=0) > 0.09).all(), "without feedback none of them is"


@pytest.mark.parametrize("kind", fusion.KINDS)
def test_the_fused_hull_is_inside_every_local_hull(kind: str) -> None:
    counts = tally(kind, "none")
    assert (np.array(counts.fused)[:, None] <= np.array(counts.local) * (1 + 1e-12)).all()


def test_different_parallelotopes_beat_the_parallelotope_with_all_sensors() -> None:
    counts = tally("LSUP image", "none")
    assert np.mean(counts.fused) < np.mean(counts.central)


@pytest.mark.parametrize("feedback", ["next step", "same step"])
@pytest.mark.parametrize("kind", ["LSUO", "LSUPB", "LSUCZ"])
def test_feedback_narrows_every_local_filter(kind: str, feedback: str) -> None:
    fed, alone = (np.mean(tally(kind, way).local, axis=0) for way in (feedback, "none"))
    assert (fed < alone).all()


@pytest.mark.parametrize("ratio", [0.01, 0.1, 1.0, 10.0])
@pytest.mark.parametrize(("system", "kind"), PAIRS)
def test_transfer_keeps_the_truth_and_is_never_wider_than_the_isolated_filter(
    system: str, kind: str, ratio: float
) -> None:
    point = result(system, kind, "predictor", ratio)
    assert point.inside == 1.0
    assert point.rejected == 0.0
    assert point.gain >= 0.0
    assert point.support_gain >= 0.0
    if kind not in transfer.BY_VOLUME:
        assert point.tnse_ratio <= 1.02
        assert point.widest <= 1.0


@pytest.mark.parametrize("ratio", [0.01, 1.0])
def test_a_parallelotope_alone_keeps_the_truth_and_gains_little(ratio: float) -> None:
    """The faces of a sharp source take the place of edges that later data need."""
    point = result("P3", "LSUP", "predictor", ratio)
    assert (point.inside, point.rejected) == (1.0, 0.0)
    assert 0.9 < point.width < 1.2


@pytest.mark.parametrize("ratio", [0.01, 0.1, 1.0, 10.0])
def test_with_exact_hulls_transfer_is_not_wider_at_any_step(ratio: float) -> None:
    assert result("P3", "LSUO lp", "predictor", ratio).worst_step <= 1.0 + 1e-9


@pytest.mark.parametrize(("system", "kind"), PAIRS)
def test_a_sharp_source_helps_much_and_a_wide_one_does_no_harm(system: str, kind: str) -> None:
    sharp, wide = (result(system, kind, "predictor", ratio) for ratio in (0.01, 10.0))
    assert sharp.tnse_ratio <= 0.5
    assert sharp.support_gain > 0.8 > 0.1 > wide.support_gain
    if kind not in transfer.BY_VOLUME:
        assert sharp.width <= 0.7
        assert sharp.gain > 0.9 > 0.1 > wide.gain
    assert wide.width == pytest.approx(1.0, abs=0.05)


def test_a_transfer_shrinks_the_volume_of_a_parallelotope_and_not_always_its_hull() -> None:
    point = result("P3", "LSUP", "predictor", 0.01)
    assert point.support_gain > 1.0 > point.gain
    assert point.tnse_ratio < 0.5


@pytest.mark.parametrize(("system", "kind", "ratio"), [("S2", "LSUPB", 0.178), ("P3", "LSUCZ", 0.562)])
def test_the_data_predictor_loses_the_truth(system: str, kind: str, ratio: float) -> None:
    point = result(system, kind, "data-predictor", ratio)
    assert point.inside < 0.85
    assert result(system, kind, "predictor", ratio).inside == 1.0


def test_a_quick_run_meets_its_checks_and_tells_everything() -> None:
    for outcome in (fusion.run(quick=True), transfer.run(quick=True)):
        assert isinstance(outcome, Outcome)
        assert [str(check) for check in outcome.checks if not check.is_met] == []
        for table in outcome.tables:
            assert len(table.csv().splitlines()) == len(table.rows) + 1
            assert len(table.markdown().splitlines()) == len(table.rows) + 4
            assert len(table.records()) == len(table.rows)
