"""A filter node when messages are late, missing, doubled, contradictory, or the node starts late."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lsu_mesh.mesh.keys import key, last_key
from lsu_mesh.mesh.messages import Measurement, Posterior, encode
from lsu_mesh.mesh.nodes.node import Node

MakeMesh = Callable[..., Any]
STEPS = 40
DURATION = STEPS * 0.02 + 0.6


def finished(mesh: Any) -> Any:
    mesh.run(DURATION)
    return mesh


class Postman:
    """Keeps back, or drops, the measurements that a rule names; ``release`` hands them over."""

    def __init__(self, rule: Callable[[str, int], bool]) -> None:
        self._rule = rule
        self.kept: list[tuple[Node, str, bytes]] = []
        self.open = False

    def __call__(self, address: str, payload: bytes, node: Node) -> bool:
        import msgpack

        if self.open or "/measurement/" not in address or node.role != "filter":
            return True
        content = msgpack.unpackb(payload)
        if not self._rule(address.rpartition("/")[2], content["step"]):
            return True
        self.kept.append((node, address, payload))
        return False

    def release(self, mesh: Any, order: random.Random | None = None) -> None:
        self.open = True
        if order is not None:
            order.shuffle(self.kept)
        for node, address, payload in self.kept:
            mesh.publish(node, node.deliver(address, payload, mesh.now))
        mesh.turn()


@pytest.mark.parametrize("seed", range(5))
def test_late_measurements_give_the_same_sets_as_the_orderly_run(mesh_of: MakeMesh, seed: int) -> None:
    orderly = finished(mesh_of(f"mesh.steps={STEPS}"))
    draw = random.Random(seed)
    late = {(sensor, k) for sensor in ("s1", "s2", "s3") for k in range(10, STEPS) if draw.random() < 0.3}
    postman = Postman(lambda sensor, k: (sensor, k) in late)
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", carry=postman))
    assert len(postman.kept) > 20
    postman.release(mesh, draw)
    for name in ("box", "para", "cz"):
        ours, theirs = mesh.newest(name), orderly.newest(name)
        assert {k: p.support for k, p in ours.items()} == {k: p.support for k, p in theirs.items()}
        assert max(p.revision for p in ours.values()) >= 1
    truth = mesh.truth()
    for name in mesh.estimators():
        for p in mesh.posteriors(name):
            assert all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))


def test_a_measurement_older_than_the_history_is_counted_and_changes_nothing(mesh_of: MakeMesh) -> None:
    postman = Postman(lambda sensor, k: sensor == "s1" and k == 3)
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", "filters.box.history=5", carry=postman))
    before = len(mesh.posteriors("box"))
    postman.release(mesh)
    assert len(mesh.posteriors("box")) == before
    assert mesh.nodes["box"].counters()["late"] == 1


def test_a_missing_measurement_is_no_strip_and_is_named(mesh_of: MakeMesh) -> None:
    postman = Postman(lambda sensor, k: sensor == "s2")
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", carry=postman))
    for posterior in mesh.posteriors("box"):
        assert posterior.missing == ["s2"]
        assert all(reference[1] != "sensor/s2" for reference in posterior.used)
        assert posterior.status == "ok"
    assert len(mesh.newest("box")) == STEPS


def test_without_any_measurement_the_set_is_predicted_and_still_holds_the_truth(mesh_of: MakeMesh) -> None:
    postman = Postman(lambda sensor, k: 10 <= k < 15)
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", carry=postman))
    truth = mesh.truth()
    newest = mesh.newest("box")
    assert [k for k, p in newest.items() if p.status == "predicted"] == list(range(10, 15))
    for k, p in newest.items():
        assert all(low <= x <= high for low, x, high in zip(p.lower, truth[k], p.upper, strict=True))


def test_a_copy_changes_nothing(mesh_of: MakeMesh) -> None:
    orderly = finished(mesh_of(f"mesh.steps={STEPS}"))
    mesh = mesh_of(f"mesh.steps={STEPS}")
    mesh.run(0.3)
    for address, message in list(mesh.sent):
        mesh.hand_over(address, encode(message))
    mesh.run(DURATION - 0.3)
    assert [p.support for p in mesh.posteriors("box")] == [p.support for p in orderly.posteriors("box")]
    assert mesh.nodes["box"].admission.duplicates > 0


def test_a_missing_input_is_waited_for_and_never_guessed(mesh_of: MakeMesh) -> None:
    kept: list[tuple[Node, str, bytes]] = []

    def carry(address: str, payload: bytes, node: Node) -> bool:
        import msgpack

        if "/input/" in address and node.name == "box" and msgpack.unpackb(payload)["step"] == 7:
            kept.append((node, address, payload))
            return False
        return True

    orderly = finished(mesh_of("mesh.steps=30"))
    mesh = finished(mesh_of("mesh.steps=30", carry=carry))
    assert max(mesh.newest("box")) == 7
    assert mesh.nodes["box"].waiting_for() == "input of step 7 (lsu/v1/demo/input/plant)"
    mesh.run(1.0)
    health = mesh.nodes["box"].health(mesh.now)
    assert health.level == "WARN"
    assert any(
        reason.startswith("waiting for input of step 7 (lsu/v1/demo/input/plant) for ") for reason in health.reasons
    )
    node, address, payload = kept[0]
    mesh.publish(node, node.deliver(address, payload, mesh.now))
    mesh.turn()
    assert {k: p.support for k, p in mesh.newest("box").items()} == {
        k: p.support for k, p in orderly.newest("box").items()
    }


def test_a_declared_input_box_replaces_a_missing_input_and_holds_the_truth(mesh_of: MakeMesh) -> None:
    def carry(address: str, payload: bytes, node: Node) -> bool:
        return not ("/input/" in address and node.name == "box")

    mesh = finished(mesh_of(f"mesh.steps={STEPS}", "model.input_box={lower=[-5.0], upper=[5.0]}", carry=carry))
    truth = mesh.truth()
    assert max(mesh.newest("box")) >= STEPS - 1
    for p in mesh.posteriors("box"):
        assert all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))


def biased(step: int, size: float = 5.0) -> str:
    return f'sensors.s2.faults=[{{kind="bias", from={step}, to={step}, size={size}}}]'


def test_a_wrong_measurement_is_left_out_named_and_does_no_harm(mesh_of: MakeMesh) -> None:
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", biased(20)))
    truth = mesh.truth()
    (event,) = [e for e in mesh.events("contradiction") if e.name == "box"]
    assert event.about["sensor"] == "s2"
    assert event.about["step"] == 20
    assert 3.0 < event.about["gap"] < 6.0
    status = {k: p.status for k, p in mesh.newest("box").items()}
    assert [k for k, s in status.items() if s == "inconsistent"] == [20]
    for name in mesh.estimators():
        for p in mesh.posteriors(name):
            assert all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True)), name


def test_after_contradictions_in_a_row_the_filter_resets_into_a_new_epoch(mesh_of: MakeMesh) -> None:
    fault = 'sensors.s2.faults=[{kind="bias", from=10, to=40, size=5.0}]'
    domain = "model.domain={lower=[-50.0, -50.0, -50.0], upper=[50.0, 50.0, 50.0]}"
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", fault, domain, "filters.box.reset_after=3"))
    assert next(e.step for e in mesh.events("reset") if e.name == "box") == 12
    newest = mesh.newest("box")
    assert newest[11].epoch == 0
    assert newest[13].epoch == 1


def test_without_a_domain_a_reset_starts_from_the_prior_carried_through_all_inputs(mesh_of: MakeMesh) -> None:
    fault = 'sensors.s2.faults=[{kind="bias", from=10, to=20, size=5.0}]'
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", fault, "filters.box.reset_after=3"))
    first, *_ = [e for e in mesh.events("reset") if e.name == "box"]
    assert "the prior carried through all inputs" in first.text
    newest = mesh.newest("box")
    assert newest[12].base == "reach"
    assert newest[12].status == "inconsistent"
    assert newest[STEPS].status == "ok"
    assert newest[STEPS].epoch == len([e for e in mesh.events("reset") if e.name == "box"])


def test_with_nothing_sound_to_start_again_from_a_reset_is_impossible_and_said(mesh_of: MakeMesh) -> None:
    fault = 'sensors.s2.faults=[{kind="bias", from=75, to=90, size=5.0}]'
    mesh = mesh_of("mesh.steps=100", fault, "filters.box.reset_after=3")
    mesh.run(0.8)
    mesh.kill("box")
    mesh.start("filter", "box")
    mesh.run(1.6)
    assert any(e.name == "box" for e in mesh.events("reset-impossible"))
    assert max(mesh.newest("box")) == 100


def test_another_value_of_a_sensor_and_step_is_a_datum_of_its_own_and_named_where_it_contradicts(
    mesh_of: MakeMesh,
) -> None:
    mesh = mesh_of(f"mesh.steps={STEPS}")
    mesh.run(0.3)
    first = next(m for m in mesh.of(Measurement, "s1") if m.step == 5)
    other = Measurement(
        v=1, src=first.src, boot="f" * 16, seq=0, step=5, sent_ns=1, origin_ns=1, model=first.model, y=[99.0], time_ns=0
    )
    mesh.hand_over(key("demo", "measurement", "s1"), encode(other))
    mesh.turn()
    (event,) = [e for e in mesh.events("contradiction") if e.name == "box"]
    assert (event.about["sensor"], event.about["step"], event.about["y"]) == ("s1", 5, 99.0)
    truth = mesh.truth()
    assert all((np.array(p.lower) <= truth[p.step]).all() for p in mesh.posteriors("box"))
    assert all((truth[p.step] <= np.array(p.upper)).all() for p in mesh.posteriors("box"))


def test_a_filter_that_starts_late_joins_from_the_fused_set_and_holds_the_truth(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=100")
    mesh.kill("box")
    mesh.run(1.0)
    assert max(mesh.newest("main")) >= 45, "the others go on"
    mesh.start("filter", "box")
    mesh.run(1.5)
    posteriors = mesh.posteriors("box")
    assert posteriors[0].step > 45
    assert posteriors[0].status == "restarted"
    assert posteriors[0].base[0] == "fused"
    assert posteriors[-1].step == 100
    truth = mesh.truth()
    for p in posteriors:
        assert all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))


def test_a_filter_that_starts_late_takes_its_last_posterior_from_the_fusion(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=100")
    mesh.run(1.0)
    mesh.kill("box")
    last = mesh.nodes["main"].last["box"]
    node = mesh.start("filter", "box")
    node.deliver(key("demo", "posterior", "box"), encode(last), mesh.now)
    mesh.run(1.5)
    started = [p for p in mesh.posteriors("box") if p.boot == node.boot]
    assert started[0].base in (last.reference, *(("fused", m.src, m.boot, m.seq) for m in mesh.posteriors("main")))
    assert started[-1].step == 100
    assert last_key("demo", "box") == "lsu/v1/demo/last/box"


def test_with_nothing_sound_to_start_from_the_filter_waits_and_says_so(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=100")
    mesh.kill("box")
    mesh.kill("main")
    mesh.run(1.0)
    mesh.start("filter", "box")
    mesh.run(1.0)
    assert mesh.posteriors("box") == []
    assert "a sound set to start from" in mesh.nodes["box"].waiting_for()


def test_a_filter_that_starts_late_may_start_from_the_domain(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=100", "model.domain={lower=[-50.0, -50.0, -50.0], upper=[50.0, 50.0, 50.0]}")
    mesh.kill("box")
    mesh.kill("main")
    mesh.run(1.0)
    mesh.start("filter", "box")
    mesh.run(1.5)
    posteriors: list[Posterior] = mesh.posteriors("box")
    assert posteriors[0].base == "domain"
    truth = mesh.truth()
    for p in posteriors:
        assert all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))


def test_data_of_a_step_before_the_start_do_not_hide_late_data_of_a_step_after_it(mesh_of: MakeMesh) -> None:
    early, late = 100, 170
    postman = Postman(lambda sensor, k: sensor == "s2" and k == late)
    mesh = mesh_of("mesh.steps=200", "filters.box.history=128", carry=postman)
    mesh.run(1.0)
    mesh.kill("box")
    mesh.run(1.4)
    node = mesh.start("filter", "box")
    mesh.run(2.0)
    again = [p for p in mesh.posteriors("box") if p.boot == node.boot]
    assert early < again[0].step < late, "one it cannot do again, the other it has to"
    assert mesh.newest("box")[late].missing == ["s2"]
    measured = {m.step: m for m in mesh.of(Measurement, "s2")}
    for m in (measured[early], measured[late]):
        mesh.publish(node, node.deliver(key("demo", "measurement", "s2"), encode(m), mesh.now))
    mesh.turn()
    assert mesh.newest("box")[late].missing == []
    assert mesh.newest("box")[late].revision == 1
