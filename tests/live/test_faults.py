"""Real processes are killed, frozen and cut off: estimates come back, hold the truth, and nothing is lost.

Limits are wide here, so that a slow machine passes; the strict ones are those of the full run.
"""

from __future__ import annotations

from collections.abc import Iterator

import live_faults
import pytest
from live_faults import Outcome, stop_all
from live_mesh import LiveMesh, Seen

pytestmark = pytest.mark.live

SLOWEST_S = 30.0


@pytest.fixture(scope="module")
def mesh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveMesh]:
    """Peers that find one another."""
    with LiveMesh(tmp_path_factory.mktemp("peers")) as mesh:
        yield mesh


@pytest.fixture(scope="module")
def star(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveMesh]:
    """Clients of a router over mutual TLS, each through a proxy."""
    with LiveMesh(tmp_path_factory.mktemp("star"), star=True) as mesh:
        yield mesh


def check(outcome: Outcome) -> None:
    """What holds on any machine."""
    assert outcome.inside == outcome.estimates > 0, outcome
    assert outcome.lost == 0, outcome
    assert outcome.recovered < SLOWEST_S, outcome


def test_a_machine_that_stands_still_loses_nothing(mesh: LiveMesh) -> None:
    """For longer than publishers keep what they sent: the plant must not publish all of it before links are back."""
    outcome = live_faults.stand_still(mesh, 1.5 * mesh.configuration.cached / mesh.configuration.mesh.rate)
    check(outcome)


@pytest.mark.parametrize("role", ["plant", "sensor"])
def test_a_killed_peer_comes_back_and_nothing_is_lost(mesh: LiveMesh, role: str) -> None:
    outcome = live_faults.kill(mesh, role, down=0.3)
    check(outcome)
    assert outcome.detected is not None


def test_a_killed_filter_starts_from_a_sound_set_that_the_mesh_remembers(mesh: LiveMesh) -> None:
    forgotten = mesh.configuration.cached + mesh.steps(1.0)
    mesh.until(lambda: mesh.due() > forgotten, "no cache holds the first steps: no way from the prior")
    mesh.until(lambda: mesh.is_current(0), "estimates flow")
    before = mesh.observer.estimates["cz"][-1].message
    check(live_faults.kill(mesh, "filter", down=0.3))
    first = next(seen.message for seen in mesh.observer.estimates["cz"] if seen.message.boot != before.boot)
    assert not isinstance(first.base, str), "neither the prior nor the domain"
    topic, source, boot, sequence = first.base
    assert source in ("filter/cz", "fusion/main")
    origin = remembered(mesh.observer.estimates[source.partition("/")[2]], boot, sequence)
    assert origin.topic == topic
    assert origin.status in ("ok", "predicted")
    assert origin.epoch == before.epoch
    assert before.step - 3 <= origin.step <= first.step


def remembered(seen: list[Seen], boot: str, sequence: int):  # type: ignore[no-untyped-def]
    """The message that a reference means, as the observer heard it."""
    return next(s.message for s in seen if (s.message.boot, s.message.seq) == (boot, sequence))


def test_a_frozen_fusion_goes_on_where_the_others_are(mesh: LiveMesh) -> None:
    outcome = live_faults.freeze(mesh, "fusion", seconds=2.5)
    check(outcome)
    assert outcome.detected is not None
    assert outcome.by == "token", "after the lease"


def test_every_role_stops_cleanly_when_asked(mesh: LiveMesh) -> None:
    endings = stop_all(mesh, patience=SLOWEST_S)
    assert {ending.role for ending in endings} == {"plant", "sensor", "filter", "fusion", "recorder"}
    assert {ending.code for ending in endings} == {0}, endings


def test_a_link_that_is_cut_heals_and_what_was_missed_comes(star: LiveMesh) -> None:
    check(live_faults.cut(star, "sensor", seconds=1.5))


def test_a_bit_that_flips_is_noticed_and_the_link_begins_anew(star: LiveMesh) -> None:
    outcome = live_faults.corrupt(star, "fusion")
    check(outcome)
    assert outcome.detected is not None


def test_peers_stop_cleanly_after_their_router_is_lost(star: LiveMesh) -> None:
    star.until(lambda: star.is_current(0), "estimates flow")
    live_faults.lose_router(star)
    endings = stop_all(star, patience=2 * SLOWEST_S)
    assert {ending.code for ending in endings} == {0}, endings
