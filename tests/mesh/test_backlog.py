"""A filter that has thousands of steps in its queue."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from lsu_mesh.mesh.messages import Input, Measurement, Message, Posterior, decode, encode

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
    messages: list[Message] = []
    for _ in range(2 + last // 1000):
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


def test_a_step_of_a_long_backlog_costs_no_more_than_one_of_a_short_backlog(mesh_of: Callable[..., Any]) -> None:
    """Else a peer that has fallen behind falls behind for good."""
    cost_per_step(mesh_of, 100)
    short, long = cost_per_step(mesh_of, 1000), cost_per_step(mesh_of, 12000)
    assert long < 2 * short, "a search of the whole backlog in each step would be four times as much and more"
