"""A peer with more to do than it can, in virtual time: nothing is lost without being counted and named."""

from __future__ import annotations

from pathlib import Path

import pytest
from virtual_mesh import SECOND, VirtualMesh

from lsu_mesh.mesh.config import Configuration, load

RATE = 100.0
"""Messages a second of each of three sensors."""
SLOW_RATE = 20.0


@pytest.fixture(scope="module")
def configuration(demo: Path) -> Configuration:
    return load(demo, ["mesh.steps=1000000", "mesh.rate=100"])


def test_a_peer_at_half_of_what_it_needs_waits_for_no_more_than_is_kept_and_names_what_it_gives_up(
    configuration: Configuration,
) -> None:
    mesh = VirtualMesh(configuration, RATE, capacity=1.5 * RATE)
    mesh.run(20.0)
    assert SECOND < mesh.longest_wait <= mesh.kept_ns
    mesh.longest_wait = 0
    mesh.run(40.0)
    assert mesh.queue.is_late
    assert mesh.longest_wait <= 1.1 * SECOND, "once it is late, it stays near the present"
    mesh.rate /= 4
    mesh.longest_wait = 0
    mesh.run(2.0)
    assert not mesh.queue.is_late, "the load is over, and within 2 s the peer is current"
    mesh.longest_wait = 0
    mesh.run(10.0)
    assert mesh.longest_wait < SECOND // 10
    mesh.run(1.0, sends=False)
    truth = mesh.missing()
    assert len(truth) > 5000
    assert sorted(mesh.named()) == sorted(truth), "each is named once, and nothing else"
    assert (mesh.admission.gaps, mesh.queue.too_old) == (len(truth), len(truth))
    assert (mesh.queue.dropped, mesh.questions, mesh.queue.copies) == (0, 0, 0)
    assert len({loss.key for loss in mesh.losses}) == 3
    assert len(mesh.losses) < 60 * 3, "a late peer skips ahead in few jumps"


def test_a_peer_that_is_a_little_too_slow_reaches_the_bound_late_and_not_later(configuration: Configuration) -> None:
    mesh = VirtualMesh(configuration, SLOW_RATE, capacity=0.85 * 3 * SLOW_RATE)
    mesh.run(35.0)
    assert (mesh.queue.too_old, mesh.admission.gaps) == (0, 0), "5.25 s late, all of it is kept"
    mesh.run(60.0)
    assert mesh.longest_wait <= mesh.kept_ns
    mesh.run(10.0, sends=False)
    assert sorted(mesh.named()) == sorted(mesh.missing())
    assert mesh.admission.gaps == mesh.queue.too_old == len(mesh.missing()) > 0


def test_a_burst_that_publishers_keep_costs_nothing(configuration: Configuration) -> None:
    mesh = VirtualMesh(configuration, RATE, capacity=0.5 * 3 * RATE)
    mesh.run(10.0)  # five seconds late
    mesh.capacity = 10 * 3 * RATE
    mesh.run(5.0)
    mesh.run(1.0, sends=False)
    assert (mesh.missing(), mesh.losses, mesh.questions) == (set(), [], 0)
    assert SECOND * 4 < mesh.longest_wait <= mesh.kept_ns


def test_a_full_queue_loses_nothing_that_is_still_kept(configuration: Configuration) -> None:
    mesh = VirtualMesh(configuration, RATE, capacity=0.05 * 3 * RATE, most=1000)
    mesh.run(5.0)
    dropped = mesh.queue.dropped
    assert dropped > 300
    mesh.capacity = 10 * 3 * RATE
    mesh.run(10.0)
    mesh.run(2.0, sends=False)
    assert (mesh.missing(), mesh.losses, mesh.admission.gaps) == (set(), [], 0)
    assert mesh.queue.dropped >= dropped
    assert mesh.answered <= 2 * mesh.queue.dropped


def test_a_hole_is_asked_for_at_once_and_nothing_else(configuration: Configuration) -> None:
    mesh = VirtualMesh(configuration, RATE, capacity=10 * 3 * RATE)
    mesh.loses = lambda name, seq: name == "s2" and 200 <= seq < 250
    mesh.run(2.7)
    assert mesh.admission.gaps == 50
    mesh.run(1.0)
    assert (mesh.questions, mesh.answered, mesh.queue.copies) == (1, 50, 0)
    assert (mesh.admission.gaps, mesh.missing()) == (0, set())


def test_a_hole_is_noticed_when_it_comes_and_not_when_its_turn_comes(configuration: Configuration) -> None:
    mesh = VirtualMesh(configuration, RATE, capacity=0.6 * 3 * RATE)
    mesh.loses = lambda name, seq: name == "s2" and 800 <= seq < 850
    mesh.run(9.5)  # the queue is three seconds long: 800 has its turn after more than 13 s
    assert mesh.admission.gaps == 0
    assert (mesh.questions, mesh.answered) == (1, 50)
    mesh.capacity = 10 * 3 * RATE
    mesh.run(3.0)
    mesh.run(1.0, sends=False)
    assert (mesh.missing(), mesh.losses) == (set(), [])


def test_what_many_small_holes_have_lost_comes_with_few_questions(configuration: Configuration) -> None:
    mesh = VirtualMesh(configuration, RATE, capacity=10 * 3 * RATE)
    mesh.loses = lambda name, seq: seq < 900 and seq % 20 == 7
    mesh.run(12.0)
    mesh.run(1.0, sends=False)
    assert (mesh.missing(), mesh.losses) == (set(), [])
    assert mesh.questions <= 3 * 8 * 2 * 10


def test_what_publishers_keep_no_more_is_given_up_once_and_named(configuration: Configuration) -> None:
    mesh = VirtualMesh(configuration, RATE, capacity=10 * 3 * RATE)
    mesh.loses = lambda name, seq: name == "s3" and 100 <= seq < 150
    answers, mesh.recovery._ask = mesh.recovery._ask, lambda *_: None  # nobody answers
    mesh.run(20.0)
    assert mesh.named() == [("s3", seq) for seq in range(100, 150)]
    assert mesh.admission.gaps == 50
    mesh.recovery._ask = answers
    mesh.run(5.0)
    assert len(mesh.losses) == 1, "never asked for again"
