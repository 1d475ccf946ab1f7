"""Health as an observer sees it: worst wins, silence is STALE, and a peer says what it waits for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.message_examples import example
from lsu_mesh.mesh.messages import Health
from lsu_mesh.mesh.nodes.node import SECOND, Node
from lsu_mesh.mesh.observer import LEVELS, STALE_NS, HealthObserver, worst

MakeMesh = Callable[..., Any]


def heartbeat(src: str, level: str = "OK", seq: int = 0, boot: str = "a" * 16, sent_ns: int = 0) -> Health:
    health = example("health")
    assert isinstance(health, Health)
    role = src.partition("/")[0]
    return structs.replace(health, src=src, role=role, level=level, seq=seq, boot=boot, sent_ns=sent_ns)


@pytest.fixture
def configuration(demo: Path) -> Configuration:
    return load(demo)


@pytest.fixture
def observer(configuration: Configuration) -> HealthObserver:
    """Has heard everybody at time 0."""
    observer = HealthObserver(configuration, 0)
    for role, name in configuration.peers():
        observer.record(heartbeat(f"{role}/{name}"), 0)
    return observer


def level_of(observer: HealthObserver, name: str, now: int) -> str:
    return next(peer.level for peer in observer.peers(now) if peer.name == name)


def test_the_worst_level_wins(observer: HealthObserver) -> None:
    assert observer.level(SECOND) == "OK"
    for number, level in enumerate(("WARN", "ERROR"), start=1):
        observer.record(heartbeat(f"filter/{('box', 'cz')[number - 1]}", level, seq=1), SECOND)
        assert observer.level(SECOND) == level
    assert [worst(LEVELS[: i + 1]) for i in range(4)] == list(LEVELS)
    assert worst([]) == "OK"


def test_a_peer_whose_heartbeats_stop_is_stale_until_the_next(observer: HealthObserver) -> None:
    assert level_of(observer, "box", STALE_NS - 1) == "OK"
    assert level_of(observer, "box", STALE_NS) == "STALE"
    observer.record(heartbeat("filter/box", seq=1), STALE_NS)
    assert level_of(observer, "box", STALE_NS) == "OK"


def test_a_peer_that_has_left_is_stale_at_once(observer: HealthObserver) -> None:
    observer.record_presence("s1", False)
    peer = next(peer for peer in observer.peers(1) if peer.name == "s1")
    assert (peer.level, peer.reasons[0]) == ("STALE", "left the mesh")
    observer.record_presence("s1", True)
    assert level_of(observer, "s1", 1) == "OK"


def test_a_peer_that_was_never_heard_is_stale_after_a_while(configuration: Configuration) -> None:
    observer = HealthObserver(configuration, 7 * SECOND)
    assert level_of(observer, "cz", 8 * SECOND) == "WARN"
    assert level_of(observer, "cz", 7 * SECOND + STALE_NS) == "STALE"
    assert [peer.name for peer in observer.peers(0)] == [name for _, name in configuration.peers()]


def test_a_heartbeat_of_an_earlier_life_does_not_count(observer: HealthObserver) -> None:
    observer.record(heartbeat("filter/box", "ERROR", boot="b" * 16, sent_ns=10), 1)
    observer.record(heartbeat("filter/box", "OK", seq=5, boot="a" * 16, sent_ns=9), 2)
    assert level_of(observer, "box", 3) == "ERROR"


def test_a_filter_names_the_sensor_that_has_fallen_silent(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=400")
    mesh.run(1.0, tick_ms=20)
    assert mesh.nodes["cz"].health(mesh.now).level == "OK"
    mesh.kill("s2")
    mesh.run(3.0, tick_ms=20)
    health = mesh.nodes["cz"].health(mesh.now)
    assert health.level == "WARN"
    assert health.reasons == ["nothing from lsu/v1/demo/measurement/s2 for 3 s"]
    mesh.start("sensor", "s2")
    mesh.run(0.2, tick_ms=20)
    assert mesh.nodes["cz"].health(mesh.now).level == "OK"


def test_a_refusal_is_told_for_five_seconds_and_counted_for_ever(mesh_of: MakeMesh) -> None:
    node: Node = mesh_of("mesh.steps=5").nodes["box"]
    node.deliver("lsu/v1/demo/measurement/s1", b"\xc1", SECOND)
    told = node.health(SECOND)
    assert told.level == "WARN"
    (reason,) = told.reasons
    assert reason.startswith("refused 1 message(s) so far, last: lsu/v1/demo/measurement/s1: format: ")
    later = node.health(7 * SECOND)
    assert (later.level, later.counters["refused.format"]) == ("OK", 1)


def test_an_error_event_makes_the_health_an_error_for_five_seconds(mesh_of: MakeMesh) -> None:
    node: Node = mesh_of("mesh.steps=5").nodes["box"]
    node.event("ERROR", "reset", "…", SECOND, 1, {})
    assert [node.health(t * SECOND).level for t in (1, 5, 6, 7)] == ["ERROR", "ERROR", "OK", "OK"]
