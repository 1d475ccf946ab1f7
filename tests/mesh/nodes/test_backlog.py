"""Estimators that have thousands of steps in their queue, or get more than they can do."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest

from lsu_mesh.mesh.estimation import timeline
from lsu_mesh.mesh.messages import Event, Fused, Health, Input, Measurement, Message, Posterior, decode, encode
from lsu_mesh.mesh.nodes import estimator, fusion

STEPS = 1800
"""Three references a step: more than one message may list."""


def test_what_a_long_backlog_leads_to_is_accepted_by_receivers(mesh_of: Callable[..., Any]) -> None:
    mesh = mesh_of(f"mesh.steps={STEPS}", "mesh.rate=1000.0")
    for name in mesh.estimators():
        mesh.kill(name)
    mesh.run(STEPS / 1000 + 0.1)
    node = mesh.start("filter", "box")
    for address, message in mesh.sent:
        if isinstance(message, Input | Measurement):
            node.deliver(address, encode(message), mesh.now)
    published = [m for m in ticked(node, STEPS, mesh.now) if isinstance(m, Posterior)]
    assert node.counters()["behind"] > STEPS / 2
    assert published[-1].step == STEPS
    for message in published:
        assert decode("posterior", encode(message)) == message
    used = {reference for message in published for reference in message.used}
    assert len(used) == 3 * STEPS - 1


def ticked(node: Any, last: int, now: int) -> list[Message]:
    """What the node publishes until it is past step ``last``; a tick does a limited number of steps."""
    messages: list[Message] = node.tick(now)
    while node.wakeup() == 0:  # at once: there is more to do
        messages += node.tick(now)
    assert node.step() >= last
    return messages


def cost_per_step(mesh_of: Callable[..., Any], steps: int) -> float:
    """Processor time that a filter needs for one step of a backlog, in seconds."""
    mesh = mesh_of(f"mesh.steps={steps}", "mesh.rate=1000.0")
    for name in mesh.estimators():
        mesh.kill(name)
    mesh.run(steps / 1000 + 0.1, tick_ms=50)
    node = mesh.start("filter", "box")
    heard = [(address, message) for address, message in mesh.sent if isinstance(message, Input | Measurement)]
    for address, message in heard[:20]:
        node.deliver(address, encode(message), mesh.now)
    node.tick(mesh.now)  # it has begun when the backlog comes
    for address, message in heard[20:]:
        node.deliver(address, encode(message), mesh.now)
    began = time.process_time()
    ticked(node, steps, mesh.now)
    assert node.counters()["behind"] > steps / 2
    return (time.process_time() - began) / steps


@pytest.mark.alone
def test_a_step_of_a_long_backlog_costs_no_more_than_one_of_a_short_backlog(mesh_of: Callable[..., Any]) -> None:
    """Else a peer that has fallen behind falls behind for good."""
    cost_per_step(mesh_of, 100)
    short, long = cost_per_step(mesh_of, 1000), cost_per_step(mesh_of, 12000)
    assert long < 2 * short, "a search of the whole backlog in each step would be four times as much and more"


AT_ONCE = 100
"""Steps of a tick, and steps that may be left then."""


@pytest.fixture(scope="module")
def received(module_mesh: Callable[..., Any]) -> Any:
    """What was said in a mesh of 2000 steps whose estimators keep up."""
    mesh = module_mesh("mesh.steps=2000", "mesh.rate=40.0", 'fusion.main.sources=["box","para"]')
    mesh.kill("cz")
    mesh.kill("main")
    mesh.run(2000 / 40 + 0.1, tick_ms=25)
    return mesh


@pytest.mark.parametrize(("role", "name"), [("filter", "box"), ("fusion", "main")])
def test_one_that_gets_more_than_a_tick_does_stays_bounded_says_so_and_catches_up(
    received: Any, monkeypatch: pytest.MonkeyPatch, role: str, name: str
) -> None:
    monkeypatch.setattr(estimator, "MAX_AT_ONCE", AT_ONCE)
    monkeypatch.setattr(fusion, "FAR_BEHIND", 10**6)
    node = received.start(role, name)
    kinds = Input | Measurement if role == "filter" else Input | Posterior
    data = [(address, m) for address, m in received.sent if isinstance(m, kinds) and m.name != name]
    backlogs, told = [], []
    for first in range(1, 2001, 250):
        for address, message in data:
            if first <= message.step < first + 250:
                node.deliver(address, encode(message), received.now)
        told += node.tick(received.now + first * 2_000_000)
        backlogs.append(node.counters()["newest"] - node.step())
    assert max(backlogs) <= AT_ONCE
    assert backlogs[-1] > timeline.BEHIND, "it did not keep up"
    reasons = [reason for m in told if isinstance(m, Health) and m.level == "WARN" for reason in m.reasons]
    assert any(reason.startswith("behind by ") for reason in reasons), reasons
    published = [m for m in [*told, *ticked(node, 2000, received.now + 10**11)] if isinstance(m, Posterior)]
    assert published[-1].step == 2000
    assert isinstance(published[-1], Fused) == (role == "fusion")
    assert node.counters()["behind"] + len(published) == 2000
    assert node.counters()["behind"] > 1500
    assert node.health(received.now + 2 * 10**11).level == "OK"
    truth = received.truth()
    for message in published:
        assert all(
            low <= x <= high for low, x, high in zip(message.lower, truth[message.step], message.upper, strict=True)
        )


def test_a_fusion_that_is_too_far_behind_goes_on_where_its_sources_are_and_says_so(received: Any) -> None:
    node = received.start("fusion", "main")
    data = [(address, m) for address, m in received.sent if isinstance(m, Input | Posterior) and m.name != "main"]

    def hear(first: int, last: int) -> None:
        for address, message in data:
            if first <= message.step <= last:
                node.deliver(address, encode(message), received.now)

    hear(1, 20)
    node.tick(received.now)
    hear(21, 1500)
    told = [*node.tick(received.now + 1), *ticked(node, 1500, received.now + 2)]
    assert node.counters()["skipped"] == 1500 - node.history - 21
    (event,) = [m for m in told if isinstance(m, Event)]
    assert (event.level, event.code) == ("WARN", "skipped-ahead")
    assert "1463 steps from step 21 on are skipped" in event.text
    fused = [m for m in told if isinstance(m, Fused)]
    assert (fused[0].base, fused[0].status, fused[0].step) == ("sources", "restarted", 1500)
    assert {src for _, src, _, _ in fused[0].used} == {"filter/box", "filter/para"}
    hear(1501, 1510)
    told = node.tick(received.now + 10**9)
    fused += [m for m in told if isinstance(m, Fused)]
    assert [m.step for m in fused] == list(range(1500, 1511))
    truth = received.truth()
    for m in fused:
        assert all(low <= x <= high for low, x, high in zip(m.lower, truth[m.step], m.upper, strict=True))


def test_a_fusion_that_is_far_behind_without_its_sources_keeps_what_it_has(received: Any) -> None:
    node = received.start("fusion", "main")
    for address, message in received.sent:
        if isinstance(message, Input) or (isinstance(message, Posterior) and message.step <= 20):
            node.deliver(address, encode(message), received.now)
    ticked(node, 2000, received.now + 10**9)
    assert node.counters()["skipped"] == 0
    assert node.last_posterior is not None
    assert node.last_posterior.step >= 1999
