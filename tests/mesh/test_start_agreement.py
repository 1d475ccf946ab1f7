"""Peers agree on the start of their mesh, in whatever order they come."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.model_answer import encode_model, model_answer
from lsu_mesh.mesh.start_agreement import ASK_AGAIN_NS, PATIENCE_NS, SECOND, StartAgreement, decider


@pytest.fixture
def configuration(demo: Path) -> Configuration:
    return load(demo, ('mesh.start_time="now"',))


def answer(configuration: Configuration, start_ns: int) -> bytes:
    return encode_model(model_answer(configuration.started(start_ns), "0" * 16))


def test_the_first_fusion_decides_and_a_filter_where_there_is_none(configuration: Configuration) -> None:
    assert decider(configuration) == ("fusion", "main")
    assert decider(replace(configuration, fusion={})) == ("filter", min(configuration.filters))
    assert decider(replace(configuration, fusion={}, filters={})) is None


def test_who_decides_waits_until_it_has_heard_of_nobody(configuration: Configuration) -> None:
    one = StartAgreement(configuration, "fusion", "main", SECOND)
    assert not one.tick(SECOND + PATIENCE_NS - 1)
    assert one.start_ns is None
    assert "fusion main decides (this process)" in one.waiting_for()
    assert one.tick(SECOND + PATIENCE_NS)
    assert one.start_ns == SECOND + PATIENCE_NS
    assert not one.tick(SECOND + 2 * PATIENCE_NS), "once"


def test_all_others_wait_for_an_answer(configuration: Configuration) -> None:
    one = StartAgreement(configuration, "sensor", "s1", 0)
    assert not one.tick(100 * PATIENCE_NS)
    assert one.waiting_for() == "the start of the mesh, which fusion main decides"
    assert one.receive(answer(configuration, 7 * SECOND + 3))
    assert one.start_ns == 7 * SECOND + 3


def test_who_decides_takes_the_start_that_it_hears_of(configuration: Configuration) -> None:
    one = StartAgreement(configuration, "fusion", "main", 0)
    assert one.receive(answer(configuration, SECOND))
    assert not one.tick(10 * PATIENCE_NS)
    assert one.start_ns == SECOND


def test_of_two_starts_the_earlier_stands(configuration: Configuration) -> None:
    early = StartAgreement(configuration, "fusion", "main", 0, start_ns=5)
    late = StartAgreement(configuration, "fusion", "main", 0, start_ns=9)
    assert not early.receive(answer(configuration, 9))
    assert late.receive(answer(configuration, 5))
    assert early.start_ns == late.start_ns == 5
    assert not late.receive(answer(configuration, 5)), "the same start changes nothing"


@pytest.mark.parametrize("payload", [b"", b"\xc1", b"\x93\x01\x02\x03", msgspec.msgpack.encode({"start_ns": "x"})])
def test_what_is_no_answer_changes_nothing(configuration: Configuration, payload: bytes) -> None:
    one = StartAgreement(configuration, "sensor", "s1", 0)
    assert not one.receive(payload)
    assert not one.receive(msgspec.msgpack.encode({"model": "x"}))
    assert one.start_ns is None


def test_questions_become_rare_once_the_start_is_known_and_soon_when_somebody_comes(
    configuration: Configuration,
) -> None:
    one = StartAgreement(configuration, "sensor", "s1", 0)
    assert [one.questions(t * SECOND // 4) for t in range(5)] == [True, False, True, False, True]
    one.receive(answer(configuration, 1))
    assert one.questions(2 * SECOND)
    assert not one.questions(2 * SECOND + ASK_AGAIN_NS - 1)
    one.ask_soon(3 * SECOND)
    assert one.questions(4 * SECOND)


@pytest.mark.parametrize("seed", range(20))
def test_peers_that_come_in_any_order_and_are_parted_end_with_one_start(
    configuration: Configuration, seed: int
) -> None:
    """Two groups that cannot hear each other decide for themselves; when they meet, all have the earlier start."""
    rng = random.Random(seed)
    peers = [
        ("fusion", "main"),
        ("fusion", "main"),
        *(("filter", name) for name in configuration.filters),
        ("sensor", "s1"),
    ]
    rng.shuffle(peers)
    born = [rng.randrange(6 * SECOND) for _ in peers]
    side = [0 if i == peers.index(("fusion", "main")) else rng.randrange(2) for i in range(len(peers))]
    agreements: dict[int, StartAgreement] = {}
    meet = 8 * SECOND
    for now in range(0, 20 * SECOND, SECOND // 10):
        for i, (role, name) in enumerate(peers):
            if now >= born[i] and i not in agreements:
                agreements[i] = StartAgreement(configuration, role, name, now)
            if i not in agreements:
                continue
            agreements[i].tick(now)
            if agreements[i].questions(now):
                for j, other in agreements.items():
                    hears = now >= meet or side[i] == side[j]
                    if j != i and hears and peers[j][0] != "sensor" and other.start_ns is not None:
                        agreements[i].receive(answer(configuration, other.start_ns))
    starts = {agreement.start_ns for agreement in agreements.values()}
    assert len(starts) == 1
    assert None not in starts
