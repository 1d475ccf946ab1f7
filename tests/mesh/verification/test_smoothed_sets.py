"""Smoothed sets are recomputed with the posteriors that they belong to, and hold the truth of their own step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from msgspec import structs

from lsu_mesh.mesh.messages import Measurement, Message, Posterior, Smoothed, Truth, decode, encode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.verification import verify

MakeMesh = Callable[..., Any]
LAG = 3
SMOOTHING = ("mesh.steps=40", f"filters.cz.lag={LAG}")
PLACE = ("filter/cz", "smoothed")


@pytest.fixture(scope="module")
def mesh(module_mesh: MakeMesh) -> Any:
    mesh = module_mesh(*SMOOTHING)
    mesh.run(1.5)
    return mesh


def recorded(mesh: Any) -> list[Message]:
    return [decode(message.topic, encode(message)) for _, message in mesh.sent]


def with_changed(messages: list[Message], place: int, **changes: Any) -> list[Message]:
    """The messages, and in the smoothed set of a step other values."""
    return [
        structs.replace(one, **changes) if isinstance(one, Smoothed) and one.step == place else one for one in messages
    ]


def test_every_smoothed_set_is_equal_bit_by_bit_and_holds_the_truth(mesh: Any) -> None:
    found = verify(mesh.configuration, recorded(mesh))
    assert found.holds
    assert found.exact[PLACE] == len(mesh.of(Smoothed)) == 40 - LAG
    assert found.unverifiable == []
    assert not found.containment.excused


@pytest.mark.parametrize("options", [(), ('filters.cz.transfer="fused"',), ('filters.cz.transfer="predictor"',)])
def test_with_late_data_and_transfers(mesh_of: MakeMesh, options: tuple[str, ...]) -> None:
    held: list[tuple[str, bytes]] = []

    def carry(address: str, payload: bytes, node: Node) -> bool:
        is_late = node.name == "cz" and "/measurement/s2" in address and decode("measurement", payload).step in (9, 20)
        if is_late:
            held.append((address, payload))
        return not is_late

    mesh = mesh_of(*SMOOTHING, *options, carry=carry)
    mesh.run(0.53)
    mesh._carry = lambda address, payload, node: True
    for address, payload in held:
        mesh.hand_over(address, payload)
    mesh.run(1.0)
    found = verify(mesh.configuration, recorded(mesh))
    assert [str(one) for one in (*found.differences, *found.unverifiable, *found.false_claims)[:3]] == []
    assert found.holds
    assert any(one.revision for one in mesh.of(Smoothed))
    assert found.exact[PLACE] == len(mesh.of(Smoothed))


def test_one_bit_of_a_smoothed_set_is_found(mesh: Any) -> None:
    messages = recorded(mesh)
    one = next(message for message in messages if isinstance(message, Smoothed) and message.step == 20)
    wider = [one.lower[0] - 1e-15, *one.lower[1:]]
    found = verify(mesh.configuration, with_changed(messages, 20, lower=wider))
    assert [(d.peer, d.topic, d.step, d.field) for d in found.differences] == [(*PLACE, 20, "lower[0]")]
    assert found.exact[PLACE] == 40 - LAG - 1


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"revision": 3}, "revision"),
        ({"guarantee": "learned"}, "guarantee"),
        ({"epoch": 2}, "epoch"),
        ({"lag": LAG + 1}, "lag"),
        ({"step": 21}, "step"),
    ],
)
def test_what_it_says_of_itself_is_compared_too(mesh: Any, changes: dict[str, Any], field: str) -> None:
    found = verify(mesh.configuration, with_changed(recorded(mesh), 20, **changes))
    assert not found.holds
    assert [(difference.topic, difference.field) for difference in found.differences] == [("smoothed", field)]


def test_another_posterior_than_that_of_its_process_is_no_base(mesh: Any) -> None:
    other = next(one for one in recorded(mesh) if isinstance(one, Posterior) and (one.name, one.step) == ("box", 23))
    found = verify(mesh.configuration, with_changed(recorded(mesh), 20, base=other.reference))
    assert [(d.field, d.recomputed) for d in found.differences] == [("base", "a posterior of the same process")]


def test_a_filter_without_a_lag_publishes_none(mesh: Any) -> None:
    messages = recorded(mesh)
    base = next(one for one in messages if isinstance(one, Posterior) and (one.name, one.step) == ("box", 23))
    false = structs.replace(
        next(one for one in messages if isinstance(one, Smoothed) and one.step == 20),
        src="filter/box", boot=base.boot, base=base.reference, algorithm=base.algorithm,
    )  # fmt: skip
    found = verify(mesh.configuration, [*messages, false])
    assert [(d.peer, d.field) for d in found.differences] == [("filter/box", "lag")]


def test_one_whose_posterior_is_not_recorded_is_unverifiable(mesh: Any) -> None:
    lost = next(one for one in recorded(mesh) if isinstance(one, Posterior) and (one.name, one.step) == ("cz", 23))
    found = verify(mesh.configuration, [one for one in recorded(mesh) if one.reference != lost.reference])
    assert not found.differences
    missing = [one for one in found.unverifiable if one.topic == "smoothed"]
    assert missing[0].step == 20
    assert "is not in the recording" in missing[0].reason
    assert {one.step for one in missing} == set(range(20, 40 - LAG + 1)), "a filter with a lag holds more than one set"
    assert found.exact[PLACE] == 19


def test_one_that_misses_the_truth_of_its_step_is_named(mesh: Any) -> None:
    messages = recorded(mesh)
    one = next(message for message in messages if isinstance(message, Smoothed) and message.step == 20)
    width = one.upper[0] - one.lower[0]
    off = [one.lower[0] + 2.0 * width, *one.lower[1:]]
    moved = with_changed(messages, 20, lower=off, upper=[one.upper[0] + 2.0 * width, *one.upper[1:]])
    found = verify(mesh.configuration, moved)
    assert [(miss.topic, miss.step) for miss in found.containment.misses] == [("smoothed", 20)]


def test_one_that_rests_on_a_broken_bound_is_excused(mesh_of: MakeMesh) -> None:
    mesh = mesh_of(*SMOOTHING, 'sensors.s2.faults=[{kind="bias", from=20, to=20, size=0.45}]')
    mesh.run(1.5)
    found = verify(mesh.configuration, recorded(mesh))
    assert found.holds
    assert list(found.containment.broken) == ["s2"]
    used = {one.step for one in mesh.of(Measurement, "s2")} & set(mesh.truth())
    assert used
    truths = {one.step: one.x for one in recorded(mesh) if isinstance(one, Truth)}
    missed = [
        one for one in mesh.of(Smoothed)
        if any(not low <= x <= high for low, x, high in zip(one.lower, truths[one.step], one.upper, strict=True))
    ]  # fmt: skip
    assert sum(found.containment.excused.values()) >= len(missed)
