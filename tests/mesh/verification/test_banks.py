"""Sets of banks are recomputed bit by bit, and one that was changed is found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from bank_mesh import DOMAIN, posteriors, targets
from local_mesh import LocalMesh
from msgspec import structs

from lsu_mesh.mesh.bank_messages import BankFused, BankMeasurement, BankPosterior, BankTruth, packed
from lsu_mesh.mesh.messages import Message
from lsu_mesh.mesh.verification import verify

FUSION = (
    "filters.second={kind='LSUP',sensors=['lidar'],instances=12}",
    "filters.third={kind='LSUPB',sensors=['radar','lidar'],instances=12}",
    "fusion.main={sources=['targets','second','third']}",
)
FAULTS = "sensors.radar.faults=[{kind='bias',from=10,to=17,size=20.0,instances=[3]},{kind='lost',from=20,to=20}]"


def sent(mesh: LocalMesh) -> list[Message]:
    return [message for _, message in mesh.sent]


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> LocalMesh:
    """Banks with faults, a restart from own sets, and a fusion."""
    folder: Path = tmp_path_factory.mktemp("banks")
    found = LocalMesh(targets(folder, *FUSION, FAULTS, DOMAIN))
    found.run(2.0)
    last = posteriors(found.sent)[18]
    found.kill("targets")
    found.run(0.5)
    found.start("filter", "targets").receive(last, found.now)
    found.kill("third")
    found.run(0.2)
    found.start("filter", "third")
    found.run(3.0)
    return found


def test_every_set_is_equal_and_holds_its_target(mesh: LocalMesh) -> None:
    found = verify(mesh.configuration, sent(mesh))
    assert found.differences == []
    assert found.unverifiable == []
    assert found.exact.total() == len(mesh.of(BankPosterior)) + len(mesh.of(BankFused))
    assert found.containment.misses == []
    assert found.containment.holding > 12 * 100
    assert found.holds


@pytest.mark.parametrize("kind", [BankPosterior, BankFused])
@pytest.mark.parametrize("field", ["lower", "upper", "point"])
def test_a_changed_number_is_found(mesh: LocalMesh, kind: type[Message], field: str) -> None:
    def change(message: BankPosterior | BankFused) -> Message:
        numbers = message.matrix(field).copy()
        numbers[7, 1] += -1e-9 if field == "lower" else 1e-9 if field == "upper" else 0.0
        numbers[7, 0] += 0.0 if field != "point" else 1e-12
        return structs.replace(message, **{field: packed(numbers)})

    name = "targets" if kind is BankPosterior else "main"
    found = verify(mesh.configuration, changed(mesh, kind, name, 9, change))
    first = next(one for one in found.differences if one.peer.endswith(name))
    assert (first.step, first.field) == (9, f"{field}[7]")
    assert not found.holds


def test_a_changed_status_is_found(mesh: LocalMesh) -> None:
    def change(message: BankPosterior) -> Message:
        return structs.replace(message, statuses=b"\x01" + message.statuses[1:])

    found = verify(mesh.configuration, changed(mesh, BankPosterior, "targets", 9, change))
    assert [one.field for one in found.differences if one.peer == "filter/targets"] == ["statuses[0]"]


def test_what_the_recorder_missed_is_unverifiable_and_not_different(mesh: LocalMesh) -> None:
    lost = [one for one in sent(mesh) if (type(one), one.name, one.step) != (BankMeasurement, "radar", 5)]
    found = verify(mesh.configuration, lost)
    assert found.differences == []
    assert {one.peer for one in found.unverifiable} == {"filter/targets", "filter/third"}
    assert min(one.step for one in found.unverifiable) == 5
    assert "is not in the recording" in found.unverifiable[0].reason


def test_a_set_that_misses_its_target_is_told(mesh: LocalMesh) -> None:
    def change(message: BankTruth) -> Message:
        x = message.matrix("x").copy()
        x[7, 1] += 1e3  # no sensor sees it
        return structs.replace(message, x=packed(x))

    found = verify(mesh.configuration, changed(mesh, BankTruth, "plant", 9, change))
    assert {(one.step, one.state) for one in found.containment.misses} == {(9, "instance 7")}
    assert not found.holds


def test_data_that_break_their_bound_excuse_a_set(tmp_path: Path) -> None:
    fault = "sensors.radar.faults=[{kind='bias',from=10,to=10,size=0.9,instances=[3]}]"
    mesh = LocalMesh(targets(tmp_path, fault))
    mesh.run(5.0)
    found = verify(mesh.configuration, sent(mesh))
    assert found.containment.misses == []
    assert found.holds


def changed(
    mesh: LocalMesh, kind: type[Message], name: str, step: int, change: Callable[..., Message]
) -> list[Message]:
    """All messages, one of them changed."""
    return [
        change(one) if isinstance(one, kind) and one.name == name and one.step == step else one for one in sent(mesh)
    ]
