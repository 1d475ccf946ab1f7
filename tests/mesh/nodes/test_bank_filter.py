"""A bank is N single filters in one peer: the same bits, sets that hold, and faults of one target that stay its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bank_mesh import DOMAIN, measurements, posteriors, targets, truths
from local_mesh import LocalMesh

from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.bank_messages import INCONSISTENT, OK, PREDICTED, RESTARTED, BankPosterior
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Event
from lsu_mesh.mesh.nodes.bank_filter import BankFilterNode
from lsu_mesh.mesh.nodes.node import Node

SECONDS = 5.0
"""Longer than all steps of the mesh take."""


def run(configuration: Configuration, lost: frozenset[tuple[str, int]] = frozenset()) -> LocalMesh:
    """All steps, without the measurements ``(sensor, number)`` that are lost."""

    def carry(address: str, payload: bytes, node: Node) -> bool:
        name = address.rpartition("/")[2]
        count = counts[name] = counts.get(name, -1) + (node.role == "filter")
        return node.role != "filter" or (name, count) not in lost

    counts: dict[str, int] = {}
    mesh = LocalMesh(configuration, carry)
    mesh.run(SECONDS)
    return mesh


def holds(mesh: LocalMesh, posterior: BankPosterior) -> np.ndarray:
    """Of each instance whether its box holds its true state."""
    x = truths(mesh.sent)[posterior.step].matrix("x")
    inside = (posterior.matrix("lower") <= x) & (x <= posterior.matrix("upper"))
    return np.asarray(inside.all(axis=1))


def own(folder: Path) -> list[str]:
    """Priors and models that differ from instance to instance."""
    rng, n = np.random.default_rng(5), 12
    lower = np.tile([-5.0, -2.0, -5.0, -2.0], (n, 1)) + rng.uniform(-1.0, 1.0, (n, 4))
    A = np.tile([[1.0, 0.1, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.1], [0.0, 0.0, 0.0, 1.0]], (n, 1, 1))
    A[:, 1, 1], A[:, 3, 3] = rng.uniform(0.5, 1.0, n), rng.uniform(0.5, 1.0, n)
    rho = np.tile([0.01, 0.05, 0.01, 0.05], (n, 1)) * rng.uniform(0.5, 2.0, (n, 1))
    np.savez(folder / "own.npz", lower=lower, upper=lower + rng.uniform(1.0, 4.0, (n, 4)), A=A, rho=rho)
    return ["model.instances.file=own.npz"]


@pytest.mark.parametrize("kind", ["LSUO", "LSUP", "LSUPB"])
@pytest.mark.parametrize("has_own", [False, True])
def test_an_instance_has_the_bits_of_a_single_filter(tmp_path: Path, kind: str, has_own: bool) -> None:
    faults = "sensors.radar.faults=[{kind='bias',from=10,to=13,size=90.0,instances=[3,7]}]"
    gaps = "sensors.lidar.faults=[{kind='lost',from=20,to=22,instances=[5]}]"
    more = own(tmp_path) if has_own else []
    configuration = targets(tmp_path, f"filters.targets.kind={kind}", faults, gaps, *more)
    mesh = run(configuration, frozenset({("radar", 4), ("lidar", 4), ("radar", 15)}))
    found, data = posteriors(mesh.sent), measurements(mesh.sent)
    assert set(found) == set(range(1, 41)) - {5}
    assert found[16].missing == ["radar"]
    instances = configuration.instances
    assert instances is not None
    models, priors = instances.models(configuration.model(["radar", "lidar"])), instances.priors(configuration.prior)
    for i in range(12):
        single = filter_class(kind)(models[i % len(models)], priors[i])  # type: ignore[call-arg]
        for k in range(1, 41):
            used = {reference[1]: reference for reference in found[k].used} if k in found else {}
            y = [np.nan, np.nan, np.nan]
            if "sensor/lidar" in used:
                y[:1] = data["lidar", k].matrix("y")[i]
            if "sensor/radar" in used:
                y[1:] = data["radar", k].matrix("y")[i]
            try:
                single.update(y)
            except InconsistentData:
                assert found[k].statuses[i] == INCONSISTENT
            if k in found:
                lower, upper = single.bounds()
                assert found[k].matrix("lower")[i].tobytes() == lower.tobytes()
                assert found[k].matrix("upper")[i].tobytes() == upper.tobytes()
                assert found[k].matrix("point")[i].tobytes() == np.asarray(single.point).tobytes()
            single.predict()
    assert [found[11].statuses[i] for i in (3, 7, 0)] == [INCONSISTENT, INCONSISTENT, OK]


@pytest.mark.parametrize("kind", ["LSUO", "LSUP", "LSUPB"])
def test_every_set_of_every_instance_holds_its_target(tmp_path: Path, kind: str) -> None:
    configuration = targets(tmp_path, f"filters.targets.kind={kind}", *own(tmp_path))
    mesh = run(configuration, frozenset(("lidar", number) for number in range(0, 40, 3)))
    found = posteriors(mesh.sent)
    assert len(found) == 40
    assert all(holds(mesh, posterior).all() for posterior in found.values())
    assert not mesh.of(Event)


def test_a_target_whose_data_are_wrong_touches_no_other(tmp_path: Path) -> None:
    fault = "sensors.radar.faults=[{kind='bias',from=10,size=90.0,instances=[3]}]"
    plain, faulty = run(targets(tmp_path)), run(targets(tmp_path, fault))
    before, after = posteriors(plain.sent), posteriors(faulty.sent)
    others = [i for i in range(12) if i != 3]
    for k in before:
        for field in ("lower", "upper", "point"):
            assert (before[k].matrix(field)[others] == after[k].matrix(field)[others]).all()
    assert [after[k].statuses[3] for k in (9, 10, 40)] == [OK, INCONSISTENT, INCONSISTENT]
    events = [(one.code, one.level) for one in faulty.of(Event) if isinstance(one, Event)]
    assert events == [("contradiction", "WARN"), ("reset-impossible", "ERROR")]
    assert faulty.nodes["targets"].counters()["contradictions"] == 31


def test_an_instance_starts_again_from_the_domain(tmp_path: Path) -> None:
    fault = "sensors.radar.faults=[{kind='bias',from=10,to=16,size=20.0,instances=[3]}]"
    mesh = run(targets(tmp_path, fault, DOMAIN))
    found = posteriors(mesh.sent)
    statuses = [found[k].statuses[3] for k in range(9, 21)]
    assert statuses[:6] == [OK, *[INCONSISTENT] * 4, RESTARTED]
    assert found[14].matrix("lower")[3].tolist() == [-99.0, -9.0, -99.0, -9.0]
    assert [found[k].epoch for k in (13, 14)] == [0, 1]
    assert all(found[k].statuses[i] == OK for k in found for i in range(12) if i != 3)
    assert [one.code for one in mesh.of(Event) if isinstance(one, Event)][:2] == ["contradiction", "reset"]


def test_a_bank_that_holds_never_starts_again(tmp_path: Path) -> None:
    fault = "sensors.radar.faults=[{kind='bias',from=10,to=30,size=90.0,instances=[3]}]"
    mesh = run(targets(tmp_path, fault, DOMAIN, "filters.targets.on_inconsistency=hold"))
    found = posteriors(mesh.sent)
    assert {found[k].statuses[3] for k in range(10, 31)} == {INCONSISTENT}
    assert found[31].statuses[3] == OK
    assert all(holds(mesh, posterior).all() for posterior in found.values()), "its prediction holds the target"


def test_a_prediction_that_leaves_the_domain_starts_again(tmp_path: Path) -> None:
    small = "model.domain={lower=[-5.0,-2.0,-5.0,-2.0],upper=[5.0,2.0,5.0,2.0]}"
    A = "model.A=[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,3.0,0.0],[0.0,0.0,0.0,1.0]]"
    mesh = run(targets(tmp_path, small, A, "filters.targets.on_inconsistency=hold"))
    texts = [one.text for one in mesh.of(Event) if isinstance(one, Event) and one.code == "reset"]
    assert texts
    assert all("left the domain; started again from it" in text for text in texts)
    assert mesh.nodes["targets"].counters()["resets"] >= len(texts)
    assert all((posterior.matrix("upper")[:, 2] <= 5.0).all() for posterior in posteriors(mesh.sent).values())


def test_a_step_without_data_is_predicted_and_one_without_messages_not_published(tmp_path: Path) -> None:
    lost = ["sensors.radar.faults=[{kind='lost',from=7,to=7}]", "sensors.lidar.faults=[{kind='lost',from=7,to=7}]"]
    mesh = run(targets(tmp_path, *lost), frozenset({("radar", 4), ("lidar", 4)}))
    found = posteriors(mesh.sent)
    assert 5 not in found
    assert set(found[7].statuses) == {PREDICTED}
    assert found[6].base == found[4].reference
    assert mesh.nodes["targets"].counters()["silent steps"] == 1
    assert all(holds(mesh, posterior).all() for posterior in found.values())


def test_a_late_message_is_counted_and_not_used(tmp_path: Path) -> None:
    held: list[tuple[str, bytes, Node]] = []

    def carry(address: str, payload: bytes, node: Node) -> bool:
        is_late = node.role == "filter" and address.endswith("/radar") and len(held) < 1
        if is_late:
            held.append((address, payload, node))
        return not is_late

    mesh = LocalMesh(targets(tmp_path), carry)
    mesh.run(1.0)
    address, payload, node = held[0]
    mesh.publish(node, node.deliver(address, payload, mesh.now))
    mesh.run(4.0)
    assert mesh.nodes["targets"].counters()["late"] == 1
    found = posteriors(mesh.sent)
    assert found[1].missing == ["radar"]
    assert all(holds(mesh, posterior).all() for posterior in found.values())


def test_a_bank_that_starts_late_carries_the_prior(tmp_path: Path) -> None:
    mesh = LocalMesh(targets(tmp_path))
    mesh.kill("targets")
    mesh.run(2.0)
    mesh.start("filter", "targets")
    mesh.run(3.0)
    found = posteriors(mesh.sent)
    first = min(found)
    assert first > 20
    assert found[first].base == "prior"
    assert all(holds(mesh, posterior).all() for posterior in found.values())


def test_a_bank_that_starts_again_from_its_last_sets(tmp_path: Path) -> None:
    mesh = LocalMesh(targets(tmp_path))
    mesh.run(2.0)
    last = posteriors(mesh.sent)[20]
    mesh.kill("targets")
    mesh.run(0.5)
    node = mesh.start("filter", "targets")
    node.receive(last, mesh.now)
    mesh.run(3.0)
    found = posteriors(mesh.sent)
    first = min(k for k, posterior in found.items() if posterior.boot == node.boot)
    assert found[first].base == last.reference
    assert set(found[first].statuses) == {RESTARTED}
    assert set(found[first + 1].statuses) == {OK}
    assert all(holds(mesh, posterior).all() for posterior in found.values())


def test_a_bank_does_not_wait_for_a_sensor_that_has_left(tmp_path: Path) -> None:
    mesh = LocalMesh(targets(tmp_path, "filters.targets.deadline=60s"))
    mesh.run(1.0)
    mesh.kill("lidar")
    mesh.run(1.0)
    before = max(posteriors(mesh.sent))
    for node in mesh.nodes.values():
        node.record_alive("lidar", False, mesh.now)
    mesh.run(3.0)
    assert before < 12
    assert max(posteriors(mesh.sent)) == 40


def test_the_posterior_of_one_target(tmp_path: Path) -> None:
    mesh = run(targets(tmp_path))
    node, last = mesh.nodes["targets"], posteriors(mesh.sent)[40]
    assert isinstance(node, BankFilterNode)
    one = node.posterior_of(7)
    assert one is not None
    assert one.lower == last.matrix("lower")[7].tolist()
    assert one.point == last.matrix("point")[7].tolist()
    assert (one.status, one.reference[1:]) == ("ok", last.reference[1:])
    assert node.posterior_of(12) is None
    assert node.posterior_of(-1) is None
