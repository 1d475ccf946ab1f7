"""A mesh whose declared r is half the true one: contradiction, suggestion, adoption, and healthy again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from local_mesh import LocalMesh

from lsu_mesh.mesh.config import ConfigurationError, load
from lsu_mesh.mesh.messages import Message, Suggestion, decode, encode
from lsu_mesh.mesh.replay import Replay, Timed
from lsu_mesh.mesh.verification import verify

ADOPTERS = ("bundle", "cz")


@pytest.fixture(scope="module")
def mesh(root: Path) -> LocalMesh:
    """400 steps of the example."""
    mesh = LocalMesh(load(root / "examples" / "learning.toml", ["mesh.steps=400"]))
    mesh.run(8.3)
    return mesh


def suggestions(mesh: LocalMesh) -> list[Suggestion]:
    return [message for _, message in mesh.sent if isinstance(message, Suggestion)]


def adoption(mesh: LocalMesh) -> int:
    """The step that the first suggestion announced."""
    steps = [s.adopt_at for s in suggestions(mesh) if s.adopt_at is not None]
    assert steps
    return steps[0]


def test_the_identifier_says_that_the_bounds_do_not_explain_the_data(mesh: LocalMesh) -> None:
    events = mesh.events("bounds-do-not-explain")
    assert events
    first = suggestions(mesh)[0]
    assert not first.explained
    assert 1.2 < first.factor <= 2.0
    assert first.adopt_at == first.last + 20
    assert first.r["a"] == [pytest.approx(1.5 * first.factor * 0.15)]
    assert first.rho == [0.1, 0.1, 0.1]


def test_filters_adopt_at_the_announced_step_in_a_new_epoch(mesh: LocalMesh) -> None:
    for name in ADOPTERS:
        newest = mesh.newest(name)
        k = adoption(mesh)
        before, at = newest[k - 1], newest[k]
        assert at.epoch > before.epoch
        assert before.guarantee == "declared"
        assert at.guarantee == "learned"
        assert at.status == "restarted"
        assert at.base == "domain"
        assert suggestions(mesh)[0].reference in at.used
        assert at.bounds.r == [suggestions(mesh)[0].r[sensor][0] for sensor in ("a", "b")]
        assert all(newest[j].guarantee == "learned" for j in range(k, 401))


def test_contradictions_end_with_the_adoption_and_the_truth_is_inside(mesh: LocalMesh) -> None:
    last = max(s.adopt_at or 0 for s in suggestions(mesh))
    events = [event.step for event in mesh.events("contradiction")]
    assert events
    assert min(events) < adoption(mesh)
    truth = mesh.truth()
    for name in ADOPTERS:
        rows = [(p, truth[k]) for k, p in mesh.newest(name).items() if k >= last]
        assert all(p.status != "inconsistent" for p, _ in rows)
        inside = [(np.array(p.lower) <= x).all() and (x <= np.array(p.upper)).all() for p, x in rows]
        assert np.mean(inside) == 1.0
    assert mesh.events("bounds-explain")


def test_the_fused_set_is_learned_too(mesh: LocalMesh) -> None:
    fused = mesh.newest("main")
    assert fused[adoption(mesh) + 2].guarantee == "learned"
    assert fused[400].status == "ok"


def test_the_estimators_publish_points_bands_and_half_widths(mesh: LocalMesh) -> None:
    truth = mesh.truth()
    for name in ("window", "kalman"):
        newest = mesh.newest(name)
        assert len(newest) == 400
        assert {p.guarantee for p in newest.values()} == {"none"}
        errors = [np.abs(np.array(newest[k].point) - truth[k]).mean() for k in range(50, 401)]
        assert np.mean(errors) < 0.12
    estimated = np.array([mesh.newest("window")[k].bounds.r for k in range(50, 401)])
    assert estimated.std() > 0
    assert 0.1 < estimated.mean() < 0.3


def recorded(mesh: LocalMesh) -> list[Message]:
    return [decode(message.topic, encode(message)) for _, message in mesh.sent]


def test_every_set_is_recomputed_bit_by_bit(mesh: LocalMesh) -> None:
    found = verify(mesh.configuration, recorded(mesh))
    assert [str(difference) for difference in found.differences[:3]] == []
    assert [str(missing) for missing in found.unverifiable[:3]] == []


def test_without_the_suggestion_the_sets_are_unverifiable_not_different(mesh: LocalMesh) -> None:
    found = verify(mesh.configuration, [m for m in recorded(mesh) if not isinstance(m, Suggestion)])
    assert found.differences == []
    assert any(missing.step >= adoption(mesh) for missing in found.unverifiable)


def test_a_replay_adopts_at_the_same_step(mesh: LocalMesh) -> None:
    messages = [Timed(message.sent_ns, message) for _, message in mesh.sent]
    replayed = [message for _, message in Replay(mesh.configuration, messages).run()]
    sets = {m.step: m for m in replayed if m.topic == "posterior" and m.name == "cz"}
    newest = mesh.newest("cz")
    assert {k: m.lower for k, m in sets.items()} == {k: m.lower for k, m in newest.items()}  # type: ignore[attr-defined]


def test_a_late_joiner_adopts_what_was_announced_before(root: Path) -> None:
    mesh = LocalMesh(load(root / "examples" / "learning.toml", ["mesh.steps=120"]))
    mesh.run(1.8)
    announced = suggestions(mesh)[0]
    node = mesh.start("filter", "cz")
    node.deliver(*next((a, encode(m)) for a, m in mesh.sent if m is announced), mesh.now)
    mesh.run(0.6)
    assert mesh.newest("cz")[120].guarantee == "learned"


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("filters.cz.adopt=\"nobody\"", 'there is no identifier "nobody"'),
        ('identifier.bounds.learn="both"', 'set learn = "r" there'),
        ('identifier.bounds.sensors=["a"]', "does not listen to b"),
        ("identifier.bounds.margin=0.5", "expected at least 1"),
        ('fusion.main.sources=["cz", "window"]', "a fusion intersects guaranteed sets only"),
        ('filters.cz.transfer_from=["window"]', "transfer"),
        ("sensors.a.simulated_r=[1.0, 2.0]", "simulated_r"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_said(root: Path, override: str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        load(
            root / "examples" / "learning.toml",
            [override, *(['filters.cz.transfer="predictor"'] if "transfer" in override else [])],
        )


def test_the_identifier_goes_on_looking_when_its_window_is_full(mesh: LocalMesh) -> None:
    looks = [(suggestion.first, suggestion.last) for suggestion in suggestions(mesh)]
    assert looks == [(max(1, last - 149), last) for last in range(50, 401, 50)], "every 50 steps, of the last 150"
