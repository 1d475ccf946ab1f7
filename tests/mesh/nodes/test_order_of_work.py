"""A set is handed out as soon as it stands: what only a recorder reads is computed after it has left."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from lsu_mesh.mesh.messages import Health, Input, Measurement, Posterior, Prediction, encode

MakeMesh = Callable[..., Any]
STEPS = 12


def fed(mesh_of: MakeMesh, role: str, name: str, *overrides: str) -> tuple[Any, int]:
    """An estimator that has got all that it listens to, and has done nothing with it."""
    mesh = mesh_of(f"mesh.steps={STEPS}", *overrides)
    mesh.kill(name)
    mesh.run(STEPS / mesh.configuration.mesh.rate + 0.5)
    node = mesh.start(role, name)
    listens = set(node.subscriptions())
    for address, message in mesh.sent:
        if (message.topic, message.name) in listens and (role == "fusion" or isinstance(message, Input | Measurement)):
            node.deliver(address, encode(message), mesh.now)
    return node, mesh.now


def recorded(log: list[str], what: str, called: Callable[..., Any]) -> Callable[..., Any]:
    """The same function, noting each call."""

    def call(*arguments: Any, **options: Any) -> Any:
        log.append(what)
        return called(*arguments, **options)

    return call


def course(node: Any, now: int, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the node has computed and handed out, in order."""
    log: list[str] = []
    for what in ("prediction", "beside", "health", "_predict_set"):
        monkeypatch.setattr(node, what, recorded(log, f"computes {what}", getattr(node, what)))
    note = log.append
    for message in node.work(now):
        note(f"hands out {message.topic} {message.step}")
    return log


@pytest.mark.parametrize(("role", "name", "topic"), [("filter", "cz", "posterior"), ("fusion", "main", "fused")])
def test_a_set_leaves_before_anything_else_is_computed(
    mesh_of: MakeMesh, monkeypatch: pytest.MonkeyPatch, role: str, name: str, topic: str
) -> None:
    node, now = fed(mesh_of, role, name, "filters.cz.lag=3")
    log = course(node, now, monkeypatch)
    handed = [k for k, entry in enumerate(log) if entry.startswith(f"hands out {topic} ")]
    assert [log[k] for k in handed] == [f"hands out {topic} {step}" for step in range(1, STEPS + 1)]
    for k, following in zip(handed, [*handed[1:], len(log)], strict=True):
        before, after = log[:k], log[k + 1 : following]
        steps = len([entry for entry in before if entry.startswith(f"hands out {topic} ")])
        assert before.count("computes _predict_set") == steps, "the time update waits until the set has left"
        assert before.count("computes prediction") == steps
        assert after[0] == "computes beside", "the smoothed sets too"
        assert "computes health" not in before
    assert "computes health" in log


def test_the_messages_of_a_turn_are_those_of_a_tick(mesh_of: MakeMesh) -> None:
    (one, now), (other, _) = (fed(mesh_of, "filter", "cz", "filters.cz.lag=3") for _ in range(2))
    told, ticked = list(one.work(now)), other.tick(now)
    assert [encode(message) for message in told] == [encode(message) for message in ticked]
    assert isinstance(told[-1], Health), "whoever reads the health reads of all that was published before"
    for topic in {message.topic for message in told}:
        sequence = [message.seq for message in told if message.topic == topic]
        assert sequence == list(range(len(sequence))), "in the order in which they leave"


@pytest.mark.parametrize("kind", ["LSUCZ", "LSUPB", "ZonotopicKalman", "WindowMAP"])
def test_without_predictions_the_sets_are_the_same(mesh_of: MakeMesh, kind: str) -> None:
    domain = ("model.domain.lower=[-9.0, -9.0, -9.0]", "model.domain.upper=[9.0, 9.0, 9.0]")
    overrides = (f'filters.cz={{kind="{kind}", sensors=["s2", "s3"]}}', 'fusion.main.sources=["box", "para"]', *domain)
    (one, now), (silent, _) = (fed(mesh_of, "filter", "cz", *overrides) for _ in range(2))
    silent.predicts = False
    told, rest = one.tick(now), silent.tick(now)
    assert len([message for message in told if isinstance(message, Prediction)]) == STEPS
    assert [message for message in rest if isinstance(message, Prediction)] == []
    sets = [[encode(message) for message in found if isinstance(message, Posterior)] for found in (told, rest)]
    assert sets[0] == sets[1]
    assert len(sets[0]) == STEPS
