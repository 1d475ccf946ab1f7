"""Whoever misses a peer that others see brings the mesh together again, and leaves the dead alone."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable

import pytest
from lsu_mesh_services.network.link_repair import BEGIN_S, FIRST_S, MAX_AGE_S, SPREAD_S, Absences, LinkRepair


def asked_at(absences: Absences, until: float, since: float = 0.0) -> list[float]:
    """Every time at which it is due, when nothing changes."""
    times = []
    while (at := absences.next_at()) is not None and at <= until:
        assert at > since, "time goes on"
        assert not absences.is_due(at - 1e-6)
        assert absences.is_due(at)
        times.append(at)
        since = at
    return times


def test_once_at_the_begin_it_asks_who_is_there_and_never_again() -> None:
    absences = Absences(begin=10.0)
    absences.record("a", True, 10.1)
    assert asked_at(absences, 1000.0) == [10.0 + BEGIN_S]


def test_a_lost_peer_is_asked_for_soon_and_then_less_and_less_often() -> None:
    absences = Absences(begin=0.0)
    asked_at(absences, BEGIN_S)
    absences.record("a", True, 4.0)
    absences.record("a", False, 5.0)
    times = asked_at(absences, 300.0)
    pauses = [later - earlier for earlier, later in itertools.pairwise(times)]
    assert FIRST_S <= times[0] - 5.0 <= FIRST_S + SPREAD_S
    assert pauses[:4] == pytest.approx([2 * FIRST_S, 4 * FIRST_S, 8 * FIRST_S, 16 * FIRST_S])
    assert pauses[-1] == pytest.approx(MAX_AGE_S), "and it never gives up"


def test_a_peer_that_is_back_is_not_asked_for() -> None:
    absences = Absences(begin=0.0)
    asked_at(absences, BEGIN_S)
    absences.record("a", False, 5.0)
    absences.record("a", True, 5.1)
    assert absences.next_at() is None
    absences.record("a", False, 6.0)
    times = asked_at(absences, 7.0)
    assert times[0] <= 6.0 + FIRST_S + SPREAD_S, "a new absence begins with the short pauses"


def test_only_those_that_others_see_are_missed() -> None:
    absences = Absences(begin=0.0)
    absences.record("seen", True, 0.1)
    absences.record("lost", False, 0.2)
    absences.record("dead", False, 0.2)
    assert absences.missed({"seen", "lost", "new"}, 1.0) == ["lost", "new"]
    absences.record("lost", True, 1.1)
    assert absences.missed({"seen", "lost", "new"}, 1.2) == ["new"], "and it is asked for again"
    assert asked_at(absences, 30.0)


def test_where_nobody_may_tell_all_who_were_lost_may_be_there() -> None:
    absences = Absences(begin=0.0)
    assert absences.missed(None, 0.1) == []
    absences.record("seen", True, 0.1)
    absences.record("lost", False, 0.2)
    assert absences.missed(None, 1.0) == ["lost"]


class Mesh:
    """What an entry knows, and what an introduction does."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("lsu_mesh_services.network.link_repair.FIRST_S", 0.01)
        monkeypatch.setattr("lsu_mesh_services.network.link_repair.SPREAD_S", 0.0)
        monkeypatch.setattr("lsu_mesh_services.network.link_repair.BEGIN_S", 1e6)
        self.elsewhere: set[str] = set()
        self.asked = threading.Semaphore(0)
        self.introduced = threading.Event()
        self.returns: list[str] = []
        self.reunion = LinkRepair(self.ask, self.introduce)

    def ask(self) -> set[str]:
        self.asked.release()
        return self.elsewhere

    def introduce(self, is_over: Callable[[], bool]) -> None:
        assert not is_over()
        for key in self.returns:
            self.reunion.record(key, True)
        assert is_over() == bool(self.returns)
        self.introduced.set()


def test_a_peer_that_others_see_is_brought_back(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = Mesh(monkeypatch)
    mesh.elsewhere, mesh.returns = {"a"}, ["a"]
    mesh.reunion.record("a", False)
    assert mesh.introduced.wait(5)
    mesh.reunion.close()
    assert mesh.reunion.introductions == 1


def test_a_dead_peer_costs_a_question_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = Mesh(monkeypatch)
    mesh.elsewhere = {"b"}
    mesh.reunion.record("b", True)
    mesh.reunion.record("a", False)
    for _ in range(3):
        assert mesh.asked.acquire(timeout=5)
    mesh.reunion.close()
    assert mesh.reunion.introductions == 0


def test_it_ends_at_once_when_nothing_is_due(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = Mesh(monkeypatch)
    mesh.reunion.close()
    assert not mesh.asked.acquire(blocking=False)


def test_a_peer_that_is_late_repairs_no_links_until_it_is_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lsu_mesh_services.network.link_repair.LATE_S", 0.01)
    mesh = Mesh(monkeypatch)
    mesh.reunion.close()
    looks, is_late = threading.Semaphore(0), threading.Event()
    is_late.set()

    def looks_whether() -> bool:
        looks.release()
        return is_late.is_set()

    mesh.reunion = LinkRepair(mesh.ask, mesh.introduce, looks_whether)
    mesh.elsewhere, mesh.returns = {"a"}, ["a"]
    mesh.reunion.record("a", False)
    for _ in range(20):
        assert looks.acquire(timeout=5)
    assert not mesh.asked.acquire(blocking=False)
    is_late.clear()
    assert mesh.introduced.wait(5)
    mesh.reunion.close()
