"""Measurements lost, late, doubled and out of order: never a wrong set, and in the end the bytes of the orderly run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from lsu_mesh import simulate
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Event, Fused, Input, Measurement, Message, Posterior, encode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.sets import to_support

FIVE = """
[mesh]
name = "five"
dt = 0.02

[model]
A = [[1.0, -0.5, 0.2], [0.5, 0.1, 0.0], [0.3, 0.0, -0.1]]
B = [[0.1], [0.6], [0.3]]
rho = [0.1, 0.1, 0.1]
prior = { lower = [-5.0, -5.0, -5.0], upper = [5.0, 5.0, 5.0] }

[sensors.a]
C = [[1.0, 0.0, 0.5]]
r = [0.3]
[sensors.b]
C = [[0.0, 1.0, 0.5], [0.2, 1.0, -1.0]]
r = [0.3, 0.4]
[sensors.c]
C = [[1.0, -1.0, 0.3]]
r = [0.3]

[filters.box]
kind = "LSUO"
sensors = ["a", "b"]
[filters.para]
kind = "LSUP"
sensors = ["a", "c"]
[filters.bundle]
kind = "LSUPB"
sensors = ["b", "c"]
[filters.cz]
kind = "LSUCZ"
sensors = ["a", "b", "c"]
[filters.zono]
kind = "ZonotopicKalman"
sensors = ["a", "b"]

[fusion.main]
sources = ["box", "para", "bundle", "cz", "zono"]
"""
LOST, LATE, DOUBLED, LATEST = 0.3, 0.2, 0.1, 10
STEP_NS = 20_000_000
FLUSH = 30
"""Steps of time after the last one, in which everything late comes in and every deadline passes."""


@dataclass
class Traffic:
    """Messages with the tick at which each is delivered; a tick's messages in random order."""

    rng: np.random.Generator
    deliveries: dict[int, list[Message]] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)

    def at(self, tick: int, message: Message) -> None:
        self.deliveries.setdefault(tick, []).append(message)

    def disorderly(self, message: Message, late: float, latest: int) -> None:
        """Late or not, doubled or not; a copy comes at any time up to the latest."""
        is_late = self.rng.random() < late
        tick = message.step + (int(self.rng.integers(1, latest + 1)) if is_late else 0)
        self.at(tick, message)
        self.counts["late"] += is_late
        if self.rng.random() < DOUBLED:
            self.at(tick + int(self.rng.integers(0, latest + 1)), message)
            self.counts["doubled"] += 1

    def due(self, tick: int) -> list[Message]:
        messages = self.deliveries.get(tick, [])
        return [messages[i] for i in self.rng.permutation(len(messages))]


@dataclass
class Outcome:
    """Everything that was published, by peer, and what the nodes say of themselves in the end."""

    nodes: dict[str, Node]
    posteriors: dict[str, list[Posterior]] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)

    def newest(self, name: str) -> dict[int, Posterior]:
        """The newest revision of each step."""
        return {message.step: message for message in self.posteriors[name]}


@pytest.fixture
def mesh(tmp_path: Path) -> Configuration:
    file = tmp_path / "five.toml"
    file.write_text(FIVE)
    return load(file, [])


def measured(mesh: Configuration, seed: int, steps: int) -> tuple[list[Measurement], list[Input], np.ndarray]:
    """All measurements that are not lost, all inputs, and the true states (T, n)."""
    model = mesh.model(mesh.sensors)
    made = simulate(model, steps, seed, x1=[1.0, 0.5, -0.5])
    rng = np.random.default_rng(seed)
    measurements, inputs = [], []
    for k in range(1, steps + 1):
        row = 0
        for name in sorted(mesh.sensors):
            count = len(mesh.sensors[name].C)
            if rng.random() >= LOST:
                y = made.Y[k - 1, row : row + count].tolist()
                measurements.append(Measurement(**common(mesh, f"sensor/{name}", k), y=y, time_ns=0))
            row += count
        inputs.append(Input(**common(mesh, "plant/plant", k), u=made.U[k - 1].tolist()))
    return measurements, inputs, made.X


def common(mesh: Configuration, src: str, k: int) -> dict[str, object]:
    return {
        "v": 1, "src": src, "boot": "0" * 16, "seq": k, "step": k, "sent_ns": k, "origin_ns": k, "model": mesh.digest()
    }  # fmt: skip


def run(mesh: Configuration, traffic: Traffic, ticks: int) -> Outcome:
    """Filters and a fusion, which gets what the filters publish in random order."""
    filters: dict[str, Node] = {name: FilterNode(mesh, name, f"{i:016x}") for i, name in enumerate(mesh.filters)}
    fusion = FusionNode(mesh, "main", "f" * 16)
    outcome = Outcome({**filters, "main": fusion})
    for tick in range(1, ticks + 1):
        now = tick * STEP_NS
        for message in traffic.due(tick):
            for node in filters.values():
                deliver(mesh, node, message, now)
            if isinstance(message, Input):
                deliver(mesh, fusion, message, now)
        for name, node in filters.items():
            published = keep(outcome, name, node.tick(now))
            for message in (published[i] for i in traffic.rng.permutation(len(published))):
                deliver(mesh, fusion, message, now)
        keep(outcome, "main", fusion.tick(now))
    return outcome


def deliver(mesh: Configuration, node: Node, message: Message, now: int) -> None:
    if (message.topic, message.name) in set(node.subscriptions()):
        assert node.deliver(key(mesh.mesh.name, message.topic, message.name), encode(message), now) == []


def keep(outcome: Outcome, name: str, messages: Iterable[Message]) -> list[Posterior]:
    posteriors = []
    for message in messages:
        if isinstance(message, Posterior):
            posteriors.append(message)
        elif isinstance(message, Event):
            outcome.events.append(message)
    outcome.posteriors.setdefault(name, []).extend(posteriors)
    return posteriors


def told(message: Posterior) -> bytes:
    """All of a posterior but when, how often, and in which message it was said."""
    used = [] if isinstance(message, Fused) else message.used  # revisions of what was fused have other numbers
    return encode(structs.replace(message, seq=0, sent_ns=0, origin_ns=0, revision=0, base="prior", used=used))


def both(mesh: Configuration, seed: int, steps: int) -> tuple[Outcome, Outcome, Traffic, np.ndarray]:
    """The orderly and the disorderly run of the same messages."""
    measurements, inputs, truth = measured(mesh, seed, steps)
    orderly, traffic = (Traffic(np.random.default_rng(seed)) for _ in range(2))
    for message in measurements:
        orderly.at(message.step, message)
        traffic.disorderly(message, LATE, LATEST)
    for message in inputs:
        orderly.at(message.step, message)
        traffic.disorderly(message, 0.05, 4)
    traffic.counts["measured"] = len(measurements)
    return run(mesh, orderly, steps + FLUSH), run(mesh, traffic, steps + FLUSH), traffic, truth


def check(mesh: Configuration, seed: int, steps: int) -> None:
    orderly, disorderly, _, truth = both(mesh, seed, steps)
    for outcome in (orderly, disorderly):
        assert outcome.events == []
        for name, posteriors in outcome.posteriors.items():
            for message in posteriors:
                x = truth[message.step - 1]
                assert (np.array(message.lower) <= x).all(), (name, message.step, message.revision)
                assert (x <= np.array(message.upper)).all(), (name, message.step, message.revision)
                assert to_support(message.support).contains(x), (name, message.step, message.revision)
    for name in disorderly.posteriors:
        wanted, found = orderly.newest(name), disorderly.newest(name)
        assert sorted(found) == list(range(1, steps + 1))
        assert [k for k in found if told(found[k]) != told(wanted[k])] == [], name


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_in_the_end_the_bytes_are_those_of_the_orderly_run_and_the_truth_is_always_inside(
    mesh: Configuration, seed: int
) -> None:
    check(mesh, seed, 100)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100, 150))
def test_disorder_over_a_long_time(mesh: Configuration, seed: int) -> None:
    check(mesh, seed, 400)


def test_the_disorder_is_as_bad_as_it_says(mesh: Configuration) -> None:
    steps = 120
    orderly, disorderly, traffic, _ = both(mesh, 5, steps)
    total = steps * len(mesh.sensors)
    assert 0.6 < traffic.counts["measured"] / total < 0.8
    assert traffic.counts["late"] > 0.15 * traffic.counts["measured"]
    assert traffic.counts["doubled"] > 0.07 * traffic.counts["measured"]
    for name, node in disorderly.nodes.items():
        health = node.health(0).counters
        assert health["rewinds"] > 10, name
        assert health["duplicates"] > 5 or name == "main"
        revisions = Counter(message.step for message in disorderly.posteriors[name])
        assert max(revisions.values()) > 2
        assert [message.revision for message in disorderly.posteriors[name] if message.step == 50] == list(
            range(revisions[50])
        )
    for node in orderly.nodes.values():
        assert node.health(0).counters["rewinds"] == 0


def test_a_revision_that_changes_only_the_bounds_of_a_source_is_published(mesh: Configuration) -> None:
    measurements, inputs, _ = measured(mesh, 7, 1)
    traffic = Traffic(np.random.default_rng(0))
    for message in (*measurements, *inputs):
        traffic.at(1, message)
    outcome = run(mesh, traffic, 5)
    fusion, (source,) = outcome.nodes["main"], outcome.posteriors["cz"]
    (first,) = outcome.posteriors["main"]
    narrower = [low + 0.1 * (high - low) for low, high in zip(first.lower, first.upper, strict=True)]
    fusion.receive(structs.replace(source, seq=1, revision=1, lower=narrower), 6 * STEP_NS)
    (second,) = keep(outcome, "main", fusion.tick(6 * STEP_NS))
    assert (second.step, second.revision, second.lower) == (1, 1, narrower)
    assert second.upper == first.upper
