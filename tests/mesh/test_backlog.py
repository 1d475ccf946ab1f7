"""A filter that has thousands of steps in its queue."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lsu_mesh.mesh.messages import Input, Measurement, Posterior, decode, encode

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
    published = [m for m in node.tick(mesh.now) if isinstance(m, Posterior)]
    assert node.counters()["behind"] > STEPS / 2
    assert published[-1].step == STEPS
    for message in published:
        assert decode("posterior", encode(message)) == message
    used = {reference for message in published for reference in message.used}
    assert len(used) == 3 * STEPS - 1
