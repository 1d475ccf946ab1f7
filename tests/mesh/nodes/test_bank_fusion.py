"""A fusion of banks: the common box of each instance, which holds its target as long as its sources do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bank_mesh import DOMAIN, posteriors, targets, truths
from local_mesh import LocalMesh

from lsu_mesh.mesh.bank_messages import INCONSISTENT, OK, BankFused
from lsu_mesh.mesh.messages import Event
from lsu_mesh.mesh.nodes.bank_fusion import BankFusionNode

OTHERS = (
    "filters.targets.sensors=['radar']",
    "filters.second={kind='LSUP',sensors=['lidar'],instances=12}",
    "filters.third={kind='LSUPB',sensors=['radar','lidar'],instances=12}",
    "fusion.main={sources=['targets','second','third']}",
)


def fused(mesh: LocalMesh) -> dict[int, BankFused]:
    """Fused boxes by step."""
    return {one.step: one for _, one in mesh.sent if isinstance(one, BankFused)}


def test_the_fused_box_is_the_intersection_and_holds_every_target(tmp_path: Path) -> None:
    mesh = LocalMesh(targets(tmp_path, *OTHERS))
    mesh.run(5.0)
    found, x = fused(mesh), truths(mesh.sent)
    assert set(found) == set(range(1, 41))
    for k, one in found.items():
        sources = [posteriors(mesh.sent, name)[k] for name in ("second", "targets", "third")]
        for i in range(12):
            low = [max(source.matrix("lower")[i, j] for source in sources) for j in range(4)]
            high = [min(source.matrix("upper")[i, j] for source in sources) for j in range(4)]
            assert one.matrix("lower")[i].tolist() == low
            assert one.matrix("upper")[i].tolist() == high
        state = x[k].matrix("x")
        assert ((one.matrix("lower") <= state) & (state <= one.matrix("upper"))).all()
        assert [reference[1] for reference in one.used] == ["filter/second", "filter/targets", "filter/third"]
        assert set(one.statuses) == {OK}
    node = mesh.nodes["main"]
    assert isinstance(node, BankFusionNode)
    assert node.last is not None
    assert node.one(node.last, 5).lower == found[40].matrix("lower")[5].tolist()


def test_a_source_that_contradicts_itself_is_left_out_and_one_that_contradicts_others_is_told(tmp_path: Path) -> None:
    fault = "sensors.radar.faults=[{kind='bias',from=1,size=8.0,instances=[3]}]"
    mesh = LocalMesh(
        targets(tmp_path, *OTHERS, fault, "model.prior={lower=[-90.0,-2.0,-90.0,-2.0],upper=[90.0,2.0,90.0,2.0]}")
    )
    mesh.run(5.0)
    found = fused(mesh)
    third = posteriors(mesh.sent, "third")
    left_out = [k for k in found if third[k].statuses[3] == INCONSISTENT]
    assert left_out
    told = [one for one in mesh.of(Event, "main") if isinstance(one, Event)]
    disjoint = [k for k in found if found[k].statuses[3] == INCONSISTENT]
    assert bool(told) == bool(disjoint)
    assert all((found[k].matrix("lower") <= found[k].matrix("upper")).all() for k in found)
    others = [i for i in range(12) if i != 3]
    assert all({found[k].statuses[i] for i in others} == {OK} for k in found)


def test_a_source_that_is_missing_is_named_and_not_waited_for_after_the_deadline(tmp_path: Path) -> None:
    mesh = LocalMesh(targets(tmp_path, *OTHERS))
    mesh.run(1.0)
    mesh.kill("second")
    mesh.run(4.0)
    found = fused(mesh)
    assert set(found) == set(range(1, 41))
    assert found[40].missing == ["second"]
    x = truths(mesh.sent)[40].matrix("x")
    assert ((found[40].matrix("lower") <= x) & (x <= found[40].matrix("upper"))).all()


def test_a_bank_starts_again_from_what_the_fusion_keeps_of_it(tmp_path: Path) -> None:
    fault = "sensors.radar.faults=[{kind='bias',from=19,to=20,size=90.0,instances=[3]}]"
    mesh = LocalMesh(targets(tmp_path, *OTHERS, fault, DOMAIN))
    mesh.run(1.95)
    mesh.kill("targets")
    mesh.run(0.2)
    fusion = mesh.nodes["main"]
    assert isinstance(fusion, BankFusionNode)
    last = fusion.last_of["targets"]
    assert last.status_codes[3] == INCONSISTENT
    node = mesh.start("filter", "targets")
    node.receive(last, mesh.now)
    mesh.run(3.0)
    found, x = posteriors(mesh.sent), truths(mesh.sent)
    again = {k: one for k, one in found.items() if one.boot == node.boot}
    assert min(again.values(), key=lambda one: one.step).base == last.reference
    for k, one in again.items():
        state = x[k].matrix("x")
        inside = ((one.matrix("lower") <= state) & (state <= one.matrix("upper"))).all(axis=1)
        assert np.array(inside).all()
        assert one.statuses[3] != INCONSISTENT
