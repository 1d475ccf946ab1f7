"""The loop around a node keeps the node's steps and heartbeats going, however much comes."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.mesh_start import MeshStart
from lsu_mesh_services.peer import Peer
from ports import free_port

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import VERSION, Health, Input, encode, encoding
from lsu_mesh.mesh.nodes.filter import FilterNode

pytestmark = pytest.mark.live
MAX_AT_ONCE = 200
FLOOD = 3 * MAX_AT_ONCE


def test_a_flood_does_not_keep_a_peer_from_its_steps_and_it_says_how_long_messages_wait(
    demo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FilterNode, "takes_at_once", MAX_AT_ONCE)
    configuration = load(demo, ["mesh.steps=100000"])
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    clock = Clock()
    with (
        Bus(SessionSettings(listen=(endpoint,), cache=2 * FLOOD), clock) as plant,
        Bus(SessionSettings(connect=(endpoint,), cache=2 * FLOOD), clock) as bus,
    ):
        node = FilterNode(configuration, "box", "1" * 16)
        peer = Peer(node, bus, clock, MeshStart(configuration, "filter", "box"))
        peer.declare()
        address, digest = key("demo", "input", "plant"), configuration.digest()
        for k in range(1, FLOOD + 1):
            common = {"v": VERSION, "src": "plant/plant", "boot": "2" * 16, "seq": k - 1, "step": k, "model": digest}
            plant.publish(address, encode(Input(**common, sent_ns=1, origin_ns=1, u=[0.5])), encoding("input"))
        end = time.monotonic() + 30.0
        while bus.waiting() < FLOOD and time.monotonic() < end:
            time.sleep(0.01)
        assert bus.waiting() >= FLOOD
        time.sleep(0.6)  # longer than anything should wait
        steps = []
        for turn in range(1, 4):
            peer.turn()
            assert turn * MAX_AT_ONCE - 10 <= node.admission.received <= turn * MAX_AT_ONCE, "no more at once"
            steps.append(node.step())
        assert steps == sorted(steps)
        assert steps[0] > 0, "it has begun before all was taken"
        health = node.health(clock.now())
        assert isinstance(health, Health)
        assert health.level == "WARN"
        assert any("in its queue" in reason for reason in health.reasons), health.reasons
        assert health.counters["queue"] >= FLOOD - MAX_AT_ONCE
        assert health.counters["queue_ms"] >= 600.0
