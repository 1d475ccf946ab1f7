"""Inputs that come late, while the input box stands in for them: every set verifies, those made twice too."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lsu_mesh.mesh.messages import Input, Message, Posterior, Prediction, decode, encode
from lsu_mesh.mesh.verification import verify

MakeMesh = Callable[..., Any]
BOX = ("model.input_box.lower=[-6.0]", "model.input_box.upper=[6.0]")
DOMAIN = ("model.domain.lower=[-100.0, -100.0, -100.0]", "model.domain.upper=[100.0, 100.0, 100.0]")
SEEDS = range(20)


def recorded(mesh: Any) -> list[Message]:
    return [decode(message.topic, encode(message)) for _, message in mesh.sent]


def run_with_late_inputs(mesh_of: MakeMesh, seed: int, *overrides: str) -> Any:
    """A share of the inputs comes up to 0.3 s late, to each receiver at another time."""
    rng = np.random.default_rng(seed)
    held: list[tuple[int, Any, str, bytes]] = []

    def carry(address: str, payload: bytes, node: Any) -> bool:
        if "/input/" not in address or rng.random() < 0.5:
            return True
        held.append((mesh.now + int(rng.integers(60, 300)) * 1_000_000, node, address, payload))
        return False

    mesh = mesh_of("mesh.steps=30", f"mesh.seed={seed}", *BOX, *overrides, carry=carry)
    for _ in range(120):
        mesh.run(0.01, tick_ms=10)
        due = [late for late in held if late[0] <= mesh.now]
        held[:] = [late for late in held if late[0] > mesh.now]
        for _, node, address, payload in due:
            mesh.publish(node, node.deliver(address, payload, mesh.now))
    return mesh


@pytest.mark.parametrize("seed", SEEDS)
def test_every_set_of_a_run_with_late_inputs_verifies(mesh_of: MakeMesh, seed: int) -> None:
    variants = (
        (),
        ('filters.para.transfer="predictor"',),
        ('filters.box.kind="WindowMAP"', 'fusion.main.sources=["cz", "para"]'),
    )
    mesh = run_with_late_inputs(mesh_of, seed, *variants[seed % 3])
    found = verify(mesh.configuration, recorded(mesh))
    assert [str(one) for one in (*found.differences[:3], *found.unverifiable[:3], *found.false_claims[:3])] == []
    sets = [message for _, message in mesh.sent if isinstance(message, Posterior | Prediction)]
    assert found.exact.total() == len(sets)
    twice = Counter((one.src, one.step) for one in sets if isinstance(one, Prediction))
    assert max(twice.values()) > 1, "a prediction was made with the box, and again with the input"
    assert any(one.missing == ["input"] for one in sets if isinstance(one, Prediction))
    assert found.holds


def test_a_prediction_names_its_base_and_its_input(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=10")
    mesh.run(0.5)
    for prediction in mesh.of(Prediction, "box"):
        base = mesh.newest("box")[prediction.step - 1]
        (used,) = prediction.used
        assert prediction.base == base.reference
        assert used == next(m.reference for m in mesh.of(Input) if m.step == prediction.step - 1)
        assert prediction.bounds == base.bounds
        assert prediction.missing == []


def test_a_start_from_the_reach_lists_the_inputs_for_which_no_box_stood_in(mesh_of: MakeMesh) -> None:
    lost = range(20, 24)

    def carry(address: str, payload: bytes, node: object) -> bool:
        return "/input/" not in address or decode("input", payload).step not in lost

    fault = 'sensors.s1.faults=[{kind="bias", from=30, to=60, size=40.0}]'
    mesh = mesh_of("mesh.steps=60", *BOX, fault, "filters.box.reset_after=2", carry=carry)
    mesh.run(2.5)
    found = verify(mesh.configuration, recorded(mesh))
    starts = [one for one in mesh.posteriors("box") if one.base == "reach"]
    assert starts
    inputs = {m.reference: m.step for m in mesh.of(Input)}
    for start in starts:
        steps = [inputs[reference] for reference in start.used if reference in inputs]
        assert steps == [k for k in range(1, start.step) if k not in lost]
    assert [str(one) for one in (*found.differences[:3], *found.unverifiable[:3], *found.false_claims[:3])] == []
