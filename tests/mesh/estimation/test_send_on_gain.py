"""Predictions that are published only where they gain enough: fewer messages, hardly wider sets, none wrong."""

from __future__ import annotations

import random
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from local_mesh import LocalMesh

from lsu_mesh import systems
from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import Measurement, Message, Prediction
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.verification import verify

STEPS = 120
BEGIN = 10
"""The prior's transient is not counted."""
P3 = systems.SYSTEMS["P3"]


def written(folder: Path, transfer: str, **more: str) -> Path:
    """P3 with two LSUPB, each with one of the outputs, that take each other's predictions."""
    parts = [
        f'[mesh]\nname = "p3"\ndt = 0.02\nsteps = {STEPS}\n{more.get("mesh", "")}',
        f"[model]\nA = {[*map(list, P3.A)]}\nB = {[*map(list, P3.B)]}\nrho = {[P3.rho] * 3}\n{more.get('model', '')}",
        "[model.prior]\nlower = [-5.0, -5.0, -5.0]\nupper = [5.0, 5.0, 5.0]",
        '[plant]\nname = "plant"\nx1 = [1.0, 0.5, -0.5]',
    ]
    for name, row in zip("ab", P3.C, strict=True):
        parts.append(f"[sensors.s{name}]\nC = [{list(row)}]\nr = [{P3.r}]")
        parts.append(f'[filters.{name}]\nkind = "LSUPB"\nsensors = ["s{name}"]\n{more.get("filter", "")}')
        parts.append(f'transfer = {{way = "predictor"{transfer}}}')
    path = folder / "p3.toml"
    path.write_text("\n".join(parts))
    return path


class Found(NamedTuple):
    """What came of runs."""

    messages: int
    width: float
    outside: int


def measured(file: Path, loss: float = 0.0, seeds: range = range(3)) -> Found:
    """Predictions published, mean width and sets outside of which the truth lies, with some predictions lost."""
    messages, widths, outside = 0, [], 0
    for seed in seeds:
        rng = random.Random(seed)
        mesh = LocalMesh(
            load(file, [f"mesh.seed={seed}"]),
            lambda address, payload, node: "/prediction/" not in address or rng.random() >= loss,  # noqa: B023
        )
        mesh.run(STEPS * 0.02 + 0.3)
        messages += len(mesh.of(Prediction))
        truth = mesh.truth()
        for name in "ab":
            newest = mesh.newest(name)
            assert len(newest) == STEPS
            for k, one in newest.items():
                lower, upper, x = np.array(one.lower), np.array(one.upper), np.array(truth[k])
                outside += not ((lower <= x) & (x <= upper)).all()
                widths += [float(np.mean(upper - lower))] if k > BEGIN else []
    return Found(messages, float(np.mean(widths)), outside)


def test_fewer_messages_hardly_wider_sets_and_none_wrong(tmp_path: Path) -> None:
    """On P3 with two LSUPB, also with a fifth of the predictions lost."""
    always = measured(written(tmp_path, ""))
    some = measured(written(tmp_path, ", publish_when = 1.1"))
    assert some.messages <= 0.6 * always.messages
    assert some.width <= 1.08 * always.width
    lossy = measured(written(tmp_path, ", publish_when = 1.1"), loss=0.2)
    assert lossy.messages <= 0.6 * always.messages
    assert lossy.width <= 1.15 * always.width
    assert always.outside == some.outside == lossy.outside == 0


@pytest.mark.parametrize("gain", ["hull", "support"])
def test_what_is_not_published_is_counted_leaves_no_gap_and_no_set_unproved(tmp_path: Path, gain: str) -> None:
    file = written(tmp_path, f', publish_when = 1.1, gain = "{gain}"')
    mesh = LocalMesh(load(file, ["mesh.steps=60"]))
    mesh.run(60 * 0.02 + 0.3)
    for name in "ab":
        sent = mesh.of(Prediction, name)
        assert [message.seq for message in sent] == list(range(len(sent)))
        node = mesh.nodes[name]
        assert node.counters()["predictions not sent"] == 60 - len(sent) > 0
    found = verify(mesh.configuration, [message for _, message in mesh.sent])
    assert found.holds
    assert not found.unverifiable
    assert sum(found.exact.values()) == 2 * 60 + len(mesh.of(Prediction))


def test_a_shadow_is_renewed_after_so_many_steps(tmp_path: Path) -> None:
    mesh = LocalMesh(load(written(tmp_path, ", publish_when = 1e9", filter="history = 20")))
    mesh.run(STEPS * 0.02 + 0.3)
    for name in "ab":
        steps = [message.step for message in mesh.of(Prediction, name)]
        settled = [k for k in steps if k > 5]
        assert np.diff([steps[steps.index(settled[0]) - 1], *settled]).tolist() == [20] * len(settled)


def test_by_default_every_prediction_is_published(tmp_path: Path) -> None:
    mesh = LocalMesh(load(written(tmp_path, ", publish_when = 0"), ["mesh.steps=30"]))
    mesh.run(30 * 0.02 + 0.3)
    assert len(mesh.of(Prediction, "a")) == 30
    assert "predictions not sent" not in mesh.nodes["a"].counters()


def test_a_late_measurement_publishes_no_prediction_of_a_past_step(tmp_path: Path) -> None:
    """Nobody waits for it; the prediction of the newest step is weighed anew."""
    held: list[tuple[str, bytes]] = []

    def carry(address: str, payload: bytes, node: Node) -> bool:
        if "/measurement/sa" in address and 0.40e9 <= mesh.now < 0.48e9:
            held.append((address, payload))
            return False
        return True

    mesh = LocalMesh(load(written(tmp_path, ", publish_when = 0.5"), ["mesh.steps=60"]), carry)
    mesh.run(0.7)
    assert held
    before = len(mesh.of(Prediction, "a"))
    for address, payload in held:
        mesh.hand_over(address, payload)
    mesh.turn()
    node = mesh.nodes["a"]
    assert isinstance(node, FilterNode)
    again = mesh.of(Prediction, "a")[before:]
    assert node.counters()["rewinds"] == 1
    assert all(message.step >= (node.current or 0) for message in again)


def test_a_new_epoch_is_told_for_as_long_as_a_loss_may_hide_it(tmp_path: Path) -> None:
    """A sensor that is wrong for a while makes its filter start again from the domain."""
    wrong = "[model.domain]\nlower = [-30.0, -30.0, -30.0]\nupper = [30.0, 30.0, 30.0]"
    file = written(tmp_path, ", publish_when = 1e9", model=wrong, filter="history = 16\nreset_after = 2")
    fault = 'sensors.sa.faults=[{kind="bias", from=40, to=45, size=9.0}]'
    mesh = LocalMesh(load(file, [fault]))
    mesh.run(STEPS * 0.02 + 0.3)
    own = [message for message in mesh.of(Prediction, "a") if message.epoch > 0]
    assert own
    first = own[0].step
    told = [message.step for message in mesh.of(Prediction, "a") if first <= message.step < first + 16]
    assert told == list(range(first, first + 16))


def test_without_the_input_a_prediction_is_published_unless_there_is_a_box_of_inputs(tmp_path: Path) -> None:
    box = "[model.input_box]\nlower = [-9.0]\nupper = [9.0]"
    file = written(tmp_path, ", publish_when = 1e9", model=box)
    mesh = LocalMesh(load(file, ["mesh.steps=30"]), lambda address, payload, node: "/input/" not in address)
    mesh.run(30 * 0.02 + 0.6)
    sent: list[Message] = mesh.of(Prediction, "a")
    assert 0 < len(sent) < 8
    assert len(mesh.of(Measurement)) == 60
