"""A process that runs beside another one of its name finds out, and a process that replaced another one does not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lsu_mesh.mesh.access import access
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.duplicate_process import WORDS, DuplicateProcess
from lsu_mesh.mesh.messages import Event, Health, Message, encode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.observer import HealthObserver
from lsu_mesh.mesh.processes import Processes

S = 10**9
OWN, OTHER = "1" * 16, "2" * 16


@pytest.fixture(scope="module")
def configuration(demo: Path) -> Configuration:
    return load(demo)


def health(boot: str, seq: int, sent: float, **changes: Any) -> Health:
    content: dict[str, Any] = {
        "v": 1, "src": "filter/box", "boot": boot, "seq": seq, "step": 1, "sent_ns": int(sent * S), "origin_ns": 1,
        "model": "0", "role": "filter", "level": "OK", "reasons": [], "counters": {}, "started_ns": 45_296 * S,
        "host": "lab-2",
    }  # fmt: skip
    return Health(**(content | changes))


@pytest.fixture
def duplicate() -> DuplicateProcess:
    return DuplicateProcess("filter/box", OWN)


def test_one_health_message_that_was_sent_after_the_own_start_is_enough(duplicate: DuplicateProcess) -> None:
    duplicate.record(health(OTHER, 7, sent=100.2), 100 * S, int(100.3 * S))
    complaint = duplicate.complaint(int(100.4 * S))
    assert complaint is not None
    assert complaint.startswith(WORDS)
    assert "on lab-2 since 12:34:56 UTC" in complaint
    assert "stop one" in complaint
    assert duplicate.take_news(int(100.4 * S)) == complaint
    assert duplicate.take_news(int(100.5 * S)) is None, "once"


def test_it_is_over_when_the_other_one_is_silent_for_3_s(duplicate: DuplicateProcess) -> None:
    duplicate.record(health(OTHER, 7, sent=100.2), 100 * S, 100 * S)
    assert duplicate.complaint(int(102.9 * S)) is not None
    assert duplicate.complaint(int(103.1 * S)) is None


def test_the_last_words_of_the_process_before_mean_nothing(duplicate: DuplicateProcess) -> None:
    for seq in range(5):  # a whole history at once, and again
        duplicate.record(health(OTHER, seq, sent=95.0 + seq), 100 * S, 100 * S)
        duplicate.record(health(OTHER, seq, sent=95.0 + seq), 100 * S, int(100.9 * S))
    assert duplicate.complaint(int(100.9 * S)) is None


def test_where_the_clock_of_the_other_host_is_behind_the_second_message_in_a_row_counts(
    duplicate: DuplicateProcess,
) -> None:
    duplicate.record(health(OTHER, 7, sent=50.0), 100 * S, 100 * S)
    assert duplicate.complaint(100 * S) is None
    duplicate.record(health(OTHER, 8, sent=51.0), 100 * S, 101 * S)
    assert duplicate.complaint(101 * S) is not None


def test_own_messages_and_those_of_others_mean_nothing(duplicate: DuplicateProcess) -> None:
    duplicate.record(health(OWN, 7, sent=100.2), 100 * S, 101 * S)
    duplicate.record(health(OTHER, 7, sent=100.2, src="sensor/box"), 100 * S, 101 * S)
    assert duplicate.complaint(101 * S) is None


def test_both_nodes_tell_it_in_an_event_and_at_once_in_their_health(configuration: Configuration) -> None:
    nodes = [FilterNode(configuration, "box", boot) for boot in (OWN, OTHER)]
    for i, node in enumerate(nodes):
        node.started_ns, node.host = (100 + i) * S, f"lab-{i}"
    for node, other in (nodes, nodes[::-1]):
        heard = other.health(105 * S)
        address = other.key(heard)
        node.tick(105 * S)
        assert node.deliver(address, encode(heard), int(105.2 * S)) == []
        told: list[Message] = node.tick(int(105.3 * S))
        event, state = told
        assert isinstance(event, Event)
        assert (event.code, event.level) == ("duplicate-process", "WARN")
        assert event.about == {"peer": "filter/box", "host": other.host, "boot": other.boot}
        assert isinstance(state, Health)
        assert state.level == "WARN"
        assert any(reason.startswith(f"{WORDS}on {other.host}") for reason in state.reasons)
        assert len(node.tick(int(105.4 * S))) == 0, "told once"
        assert node.health(int(112 * S)).level == "OK"


def test_every_peer_may_read_the_health_of_its_own_name_and_of_no_other(configuration: Configuration) -> None:
    for role, name in configuration.peers():
        if role != "recorder":
            reads = {key for key in access(configuration, role, name).reads if "/health/" in key}
            assert reads == {f"lsu/v1/demo/health/{name}"}


def test_observers_count_the_processes_of_a_name_and_a_restart_is_one(configuration: Configuration) -> None:
    processes, observer = Processes(), HealthObserver(configuration, 90 * S)

    def heard(boot: str, seq: int, at: float, **changes: Any) -> None:
        message = health(boot, seq, sent=at, **changes)
        processes.record(message, int(at * S))
        observer.record(message, int(at * S))

    for seq in range(3):
        heard(OWN, seq, 100 + seq, host="lab-1", started_ns=45_000 * S)
    heard(OTHER, 0, 102.5)
    assert [one.boot for one in processes.of("box", int(102.6 * S))] == [OTHER], "it replaces the other one"
    heard(OWN, 3, 103, host="lab-1", started_ns=45_000 * S, level="ERROR", reasons=["bad", f"{WORDS}there"])
    heard(OTHER, 1, 103.5, reasons=["worse"])
    assert [one.host for one in processes.of("box", int(103.6 * S))] == ["lab-1", "lab-2"]
    (box,) = [peer for peer in observer.peers(int(103.6 * S)) if peer.name == "box"]
    assert box.level == "ERROR"
    assert box.reasons == (
        "2 processes: on lab-1 since 12:30:00 UTC; on lab-2 since 12:34:56 UTC; stop all but one", "bad", "worse",
    )  # fmt: skip
    assert len(box.processes) == 2
    heard(OTHER, 2, 106.2)
    assert [one.host for one in processes.of("box", int(106.3 * S))] == ["lab-2"], "the other one is silent for 3 s"
    (box,) = [peer for peer in observer.peers(int(106.3 * S)) if peer.name == "box"]
    assert (box.level, box.reasons) == ("OK", ())
