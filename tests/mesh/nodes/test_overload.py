"""Filters that get too little processor: what their queue has given up is told to them, and they go on behind it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.lost_messages import Loss
from lsu_mesh.mesh.messages import Event, Health, Input, Measurement, Message, Posterior, encode
from lsu_mesh.mesh.nodes.node import SECOND

DOMAIN = "model.domain={lower=[-100.0, -100.0, -100.0], upper=[100.0, 100.0, 100.0]}"
STEPS, FIRST, LAST = 700, 51, 350
"""The queue gives up what is of the steps from FIRST to LAST."""
TICK_NS = 20_000_000


@pytest.fixture(scope="module")
def overloaded(module_mesh: Callable[..., Any]) -> Any:
    """What is said in a mesh of 500 Hz, whose estimators are gone."""
    mesh = module_mesh(f"mesh.steps={STEPS}", "mesh.rate=500.0", DOMAIN)
    for name in mesh.estimators():
        mesh.kill(name)
    mesh.run(STEPS / 500 + 0.1, tick_ms=20)
    return mesh


@pytest.mark.parametrize("kinds", [Input | Measurement, Measurement], ids=["all is lost", "inputs are spared"])
def test_a_filter_goes_on_in_one_jump_behind_what_its_queue_gave_up(overloaded: Any, kinds: Any) -> None:
    node = overloaded.start("filter", "box")
    keys = {key("demo", topic, name) for topic, name in node.subscriptions()}
    heard = [(address, m) for address, m in overloaded.sent if address in keys]
    lost: dict[tuple[str, str], list[int]] = {}
    for address, message in heard:
        if isinstance(message, kinds) and FIRST <= message.step <= LAST:
            lost.setdefault((address, message.boot), []).append(message.seq)
        else:
            if message.step == LAST + 1 and not node.lost.count:
                losses = [Loss(*stream, seqs[0], seqs[-1], True) for stream, seqs in lost.items()]
                node.record_lost(losses, overloaded.now)
            node.deliver(address, encode(message), overloaded.now)
    told: list[Message] = []
    passed = 0
    while node.step() < STEPS:
        told += node.tick(overloaded.now + passed)
        passed += TICK_NS
        assert passed <= SECOND, "current within a second"
    told += node.tick(overloaded.now + 2 * SECOND)

    events = [m for m in told if isinstance(m, Event)]
    (event,) = [m for m in events if m.code == "messages-lost"]
    count = len(lost) * (LAST - FIRST + 1)
    assert event.about == {"count": count} | {
        "/".join(address.split("/")[-2:]): f"{seqs[0]}-{seqs[-1]}" for (address, _), seqs in lost.items()
    }
    assert (node.admission.gaps, node.lost.too_old) == (count, count)
    (first, *_) = [m for m in told if isinstance(m, Health)]
    assert any("given up, last: " in reason for reason in first.reasons)

    jumps = [m.text for m in events if m.code == "started-over"]
    over = f"the inputs of steps {FIRST} to {LAST} are lost; starting again behind it"
    assert jumps == ([over] if kinds is not Measurement else [])
    assert node.counters()["resets"] == len(jumps)
    truth = overloaded.truth()
    published = [m for m in told if isinstance(m, Posterior)]
    assert published[-1].step == STEPS
    for m in published:
        assert all(low <= x <= high for low, x, high in zip(m.lower, truth[m.step], m.upper, strict=True))
