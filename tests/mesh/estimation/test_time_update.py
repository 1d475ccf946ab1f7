"""Inputs of a program that begin within a step: every state that they can lead to is in the set."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lsu_mesh.filters import LSUCZ, LSUO, LSUPB, Filter
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.estimation.time_update import predict_step, switched_within
from lsu_mesh.model import LSUModel
from lsu_mesh.supports import Orthotope

MESH = """
[mesh]
name = "own"
dt = 0.1
start_time = 0.0
[model]
A = [[1.0, 0.1], [0.0, 1.0]]
B = [[0.005], [0.1]]
rho = [0.0, 0.0]
[model.prior]
lower = [0.0, 0.0]
upper = [0.0, 0.0]
[model.input_box]
lower = [-4.0]
upper = [4.0]
[plant]
source = "external"
[sensors.gauge]
source = "external"
C = [[1.0, 0.0]]
r = [0.5]
rate = [9.0]
[filters.main]
kind = "LSUO"
sensors = ["gauge"]
"""
STEP_NS = 10**8


@pytest.fixture
def configuration(tmp_path: Path) -> Configuration:
    (tmp_path / "mesh.toml").write_text(MESH)
    return load(tmp_path / "mesh.toml")


def speeds(configuration: Configuration, u: float, earlier: float | None, since: int | None) -> tuple[float, float]:
    """Bounds of the speed after step 1, of a body at rest: between the inputs times 0.1 s."""
    engine = LSUO(configuration.model(["gauge"]), configuration.prior)
    before = None if earlier is None else np.array([earlier])
    predict_step(engine, configuration, 1, u=np.array([u]), earlier=before, since=since)
    lower, upper = engine.bounds()
    return float(lower[1]), float(upper[1])


def test_an_input_that_begins_with_the_step_drives_all_of_it(configuration: Configuration) -> None:
    assert speeds(configuration, 3.0, -1.0, STEP_NS) == pytest.approx((0.3, 0.3))


@pytest.mark.parametrize("since", [STEP_NS + 1, 2 * STEP_NS - 1, None])
def test_one_that_begins_within_it_may_be_any_between_the_two(configuration: Configuration, since: int | None) -> None:
    low, high = speeds(configuration, 3.0, -1.0, since)
    assert (low, high) == pytest.approx((-0.1, 0.3))
    assert low <= -0.1
    assert high >= 0.3


@pytest.mark.parametrize("kind", [LSUO, LSUPB, LSUCZ])
def test_a_push_that_comes_late_gains_speed_and_no_way(configuration: Configuration, kind: type[Filter]) -> None:
    """At rest, u = -1 for half of the step and then 3: the speed is 0.1, the way -1 · .00375 + 3 · .00125 = 0."""
    engine = kind(configuration.model(["gauge"]), configuration.prior)
    predict_step(engine, configuration, 1, u=np.array([3.0]), earlier=np.array([-1.0]), since=STEP_NS * 3 // 2)
    assert engine.support.contains([0.0, 0.1])
    assert not engine.support.contains([0.02, 0.1]), "and no more than that"


def test_before_the_first_input_any_of_the_box_acts(configuration: Configuration) -> None:
    assert speeds(configuration, 3.0, None, STEP_NS + 7) == pytest.approx((-0.4, 0.4))


@pytest.mark.parametrize("scale", [1.0, 1e-160, 1e-170])
def test_the_spread_of_a_state_is_never_rounded_down_and_none_where_nothing_drives_it(scale: float) -> None:
    """Against exact rationals, also where products of the numbers are too small for floating point."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        B = np.vstack([scale * rng.normal(size=(2, 2)), np.zeros((1, 2))])
        lower = scale * rng.normal(size=2)
        upper = lower + scale * rng.uniform(size=2)
        model = LSUModel(A=np.eye(3), B=B, C=np.eye(3), rho=[0.0] * 3, r=[1.0] * 3)
        u, wider = switched_within(model, Orthotope(lower, upper))
        assert isinstance(u, np.ndarray)
        for i in range(3):
            row = [Fraction(b) for b in B[i]]
            for corner in (lower, upper):
                reach = sum(abs(b) * abs(Fraction(c) - Fraction(m)) for b, c, m in zip(row, corner, u, strict=True))
                assert Fraction(wider.rho[3 + i]) >= reach
        assert wider.rho[5] == 0.0
