"""The benchmark mesh runs without a network, and its messages have the sizes that the relay sends."""

from __future__ import annotations

import pytest

from lsu_mesh.experiments.mesh_speed.benchmark_mesh import FUSION, NAME, configuration
from lsu_mesh.experiments.mesh_speed.local_steps import local_steps, message_sizes
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Fused, Posterior, Truth, decode


@pytest.mark.parametrize("states", [3, 5])
def test_every_step_ends_in_a_fused_set_that_holds_the_truth(states: int) -> None:
    mesh = configuration(50.0, 4, states=states)
    for k, step in enumerate(local_steps(mesh, 20), 1):
        fused = decode("fused", step[key(NAME, "fused", FUSION)])
        truth = decode("truth", step[key(NAME, "truth", "plant")])
        assert isinstance(fused, Fused)
        assert isinstance(truth, Truth)
        assert (fused.step, fused.missing, fused.status) == (k, [], "ok")
        assert all(low <= x <= high for low, x, high in zip(fused.lower, truth.x, fused.upper, strict=True))
        posteriors = [decode("posterior", step[key(NAME, "posterior", f"f{j}")]) for j in (1, 2, 3, 4)]
        assert [p.kind for p in posteriors if isinstance(p, Posterior)] == ["LSUO", "LSUP", "LSUCZ", "LSUO"]


@pytest.mark.parametrize("rate", [50.0, 30.0, 1000.0 / 7])
def test_rounding_puts_no_two_steps_into_one(rate: float) -> None:
    mesh = configuration(rate, 1)
    assert all(key(NAME, "truth", "plant") in step for step in local_steps(mesh, 300))


def test_sizes_are_those_of_the_messages() -> None:
    mesh = configuration(50.0, 2)
    sizes, step = message_sizes(mesh, 20), local_steps(mesh, 20)[-1]
    assert set(sizes) == set(step)
    for address, payload in step.items():
        assert sizes[address] == pytest.approx(len(payload), rel=0.25), address
