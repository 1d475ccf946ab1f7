"""One of four sources lies: with one fault allowed the fused set holds the truth, and the liar is named.

Real filter and fusion nodes, driven step by step. Four lies reach a sensor (bias, drift, stuck, random); two are made
sets, more cunning than any sensor: one that has a point in common with each other source, but hardly with two of them,
and one that lies around a point that all others hold. Both cut off the truth.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from scipy.optimize import linprog

from lsu_mesh import ConstrainedZonotope, Support, fuse, simulate
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Event, Fused, Health, Input, Measurement, Posterior
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode
from lsu_mesh.mesh.sets import to_message, to_support

FOUR = """
[mesh]
name = "four"
dt = 0.02

[model]
A = [[1.0, -0.5, 0.2], [0.5, 0.1, 0.0], [0.3, 0.0, -0.1]]
B = [[0.1], [0.6], [0.3]]
rho = [0.1, 0.1, 0.1]
domain = { lower = [-100.0, -100.0, -100.0], upper = [100.0, 100.0, 100.0] }
prior = { lower = [-5.0, -5.0, -5.0], upper = [5.0, 5.0, 5.0] }

[sensors.a]
C = [[1.0, 0.0, 0.5]]
r = [0.3]
[sensors.b]
C = [[0.0, 1.0, 0.5]]
r = [0.3]
[sensors.c]
C = [[1.0, -1.0, 0.3]]
r = [0.3]
[sensors.d]
C = [[0.5, 0.5, 1.0]]
r = [0.3]

[filters.fa]
kind = "LSUO"
sensors = ["a"]
[filters.fb]
kind = "LSUPB"
sensors = ["b"]
[filters.fc]
kind = "LSUCZ"
sensors = ["c"]
[filters.fd]
kind = "LSUP"
sensors = ["d"]

[fusion.main]
sources = ["fa", "fb", "fc", "fd"]
policy = "relaxed"
faults = 1
quarantine_after = 5
"""
SENSOR_LIES = ("bias", "drift", "stuck", "random")
MADE_LIES = ("with each", "with all")
LIES = (*SENSOR_LIES, *MADE_LIES)
STEP_NS = 20_000_000
AXES = [np.array(axis) * sign for sign in (1.0, -1.0) for axis in np.eye(3)]


@dataclass
class Story:
    """What happened: the truth, the fused sets by step, the posteriors that went in, and the events."""

    liar: str
    lying: range
    truth: np.ndarray
    fused: dict[int, Fused] = field(default_factory=dict)
    posteriors: dict[int, dict[str, Posterior]] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    complaints: dict[int, list[str]] = field(default_factory=dict)
    """Reasons in the health of the fusion."""

    def outside(self) -> list[int]:
        """Steps whose fused bounds or support miss the truth."""
        return [k for k, m in self.fused.items() if not holds(m, self.truth[k - 1])]

    def named(self, name: str) -> list[int]:
        """Steps at which a source was left out."""
        return [k for k, m in self.fused.items() if any(rejection.source == name for rejection in m.rejected)]

    def about(self, code: str) -> list[object]:
        """The sources that events of a code are about."""
        return [event.about["source"] for event in self.events if event.code == code]


def holds(message: Posterior, x: np.ndarray) -> bool:
    inside = (np.array(message.lower) <= x).all() and (x <= np.array(message.upper)).all()
    return bool(inside) and to_support(message.support).contains(x)


def configuration(folder: Path, *overrides: str) -> Configuration:
    file = folder / "four.toml"
    file.write_text(FOUR)
    return load(file, list(overrides))


def tell(mesh: Configuration, lie: str, seed: int, steps: int, liar: str = "") -> Story:
    """Run the four filters and the fusion with one liar, by default another one for each seed."""
    names, base = list(mesh.filters), mesh.model([sensor for f in mesh.filters.values() for sensor in f.sensors])
    liar = liar or names[seed % len(names)]
    lying = range(steps // 5, steps * 4 // 5)
    made = simulate(base, steps, seed, x1=[1.0, 0.5, -0.5])
    Y = distorted(made.Y, lie, names.index(liar), lying, seed)
    story = Story(liar, lying, made.X)
    filters = {name: FilterNode(mesh, name, f"{i:016x}") for i, name in enumerate(names)}
    fusion = FusionNode(mesh, "main", "f" * 16)
    for k in range(1, steps + 1):
        now = k * STEP_NS
        posteriors = {}
        u = Input(**common(mesh, "plant/plant", k), u=made.U[k - 1].tolist())
        for i, (name, node) in enumerate(filters.items()):
            sensor = mesh.filters[name].sensors[0]
            y = Measurement(**common(mesh, f"sensor/{sensor}", k), y=[float(Y[k - 1, i])], time_ns=0)
            messages = [*node.receive(u, now), *node.receive(y, now), *node.tick(now)]
            story.events += [message for message in messages if isinstance(message, Event)]
            posteriors |= {message.name: message for message in messages if isinstance(message, Posterior)}
        if lie in MADE_LIES and k in lying:
            posteriors[liar] = invented(lie, liar, posteriors, k)
        story.posteriors[k] = posteriors
        fusion.receive(u, now)
        for message in posteriors.values():
            fusion.receive(message, now)
        for message in fusion.tick(now):
            if isinstance(message, Fused):
                story.fused[message.step] = message
            elif isinstance(message, Event):
                story.events.append(message)
            elif isinstance(message, Health):
                story.complaints[k] = message.reasons
    assert list(story.fused) == list(range(1, steps + 1))
    return story


def common(mesh: Configuration, src: str, k: int) -> dict[str, object]:
    return {
        "v": 1, "src": src, "boot": "0" * 16, "seq": k, "step": k, "sent_ns": 0, "origin_ns": 0, "model": mesh.digest()
    }  # fmt: skip


def distorted(Y: np.ndarray, lie: str, row: int, lying: range, seed: int) -> np.ndarray:
    """The measurements with a lie of the sensor's."""
    rng = np.random.default_rng(seed)
    sign, Y = rng.choice([-1.0, 1.0]), Y.copy()
    on = slice(lying.start - 1, lying.stop - 1)
    count = len(lying)
    if lie == "bias":
        Y[on, row] += sign * rng.uniform(0.2, 3.0)
    elif lie == "drift":
        Y[on, row] += sign * rng.uniform(0.002, 0.1) * np.arange(1, count + 1)
    elif lie == "stuck":
        Y[on, row] = Y[lying.start - 1, row]
    elif lie == "random":
        Y[on, row] += rng.uniform(0.5, 3.0) * rng.uniform(-1.0, 1.0, count)
    return Y


def invented(lie: str, liar: str, posteriors: dict[str, Posterior], k: int) -> Posterior:
    """A set, in place of the liar's own, that contradicts no single other source, and yet cuts off the truth."""
    others = [to_support(m.support) for name, m in posteriors.items() if name != liar]
    d = AXES[k % len(AXES)]
    bodies = others if lie == "with each" else [fuse(others).support]
    points = np.array([vertices[np.argmax(vertices @ d)] for vertices in (body.vertices() for body in bodies)])
    body = triangle(points)
    lower, upper = body.bounds()
    return structs.replace(
        posteriors[liar], support=to_message(body), lower=lower.tolist(), upper=upper.tolist(),
        point=(0.5 * (lower + upper)).tolist(), status="ok",
    )  # fmt: skip


def triangle(points: np.ndarray) -> ConstrainedZonotope:
    """The convex hull of the points, as thick as a hair: ``Σ λ p, λ = (1 + ξ)/2, Σ λ = 1``."""
    count, n = points.shape
    G = np.hstack([0.5 * points.T, 1e-6 * np.eye(n)])
    A = np.hstack([np.ones((1, count)), np.zeros((1, n))])
    return ConstrainedZonotope(0.5 * points.sum(axis=0), G, A, [2.0 - count])


# -- the truth is inside, always


def check(folder: Path, lie: str, seed: int, steps: int) -> None:
    """Every other seed the filters widen their bounds, so that even a coarse lie goes on being told."""
    widen = [f'filters.{name}.on_inconsistency="widen"' for name in ("fa", "fb", "fc", "fd")] if seed % 2 else []
    story = tell(configuration(folder, *widen), lie, seed, steps)
    assert story.outside() == []
    for name in story.posteriors[1]:
        if name != story.liar:
            assert story.named(name) == [], "an honest source is never left out"


@pytest.mark.parametrize("seed", [1, 6])
@pytest.mark.parametrize("lie", LIES)
def test_with_one_fault_allowed_the_fused_set_holds_the_truth(tmp_path: Path, lie: str, seed: int) -> None:
    check(tmp_path, lie, seed, 120)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(200))
@pytest.mark.parametrize("lie", LIES)
def test_with_one_fault_allowed_the_truth_is_held_for_500_steps(tmp_path: Path, lie: str, seed: int) -> None:
    check(tmp_path, lie, seed, 500)


@pytest.mark.parametrize("lie", MADE_LIES)
def test_the_invented_sets_cut_off_the_truth_and_yet_contradict_no_single_source(tmp_path: Path, lie: str) -> None:
    story = tell(configuration(tmp_path), lie, 2, 60)
    for k in story.lying:
        sets = {name: to_support(m.support) for name, m in story.posteriors[k].items()}
        liar = sets.pop(story.liar)
        assert not liar.contains(story.truth[k - 1])
        for other in sets.values():
            assert not other.intersect(liar).is_empty()
        if lie == "with all":
            assert not fuse([liar, *sets.values()]).support.is_empty()


@pytest.mark.parametrize("lie", LIES)
def test_a_fusion_that_trusts_everybody_loses_the_truth(tmp_path: Path, lie: str) -> None:
    """Otherwise the tests above show nothing."""
    trusting = ['fusion.main.policy="intersect"', "fusion.main.faults=0"]
    trusting += [f'filters.{name}.on_inconsistency="widen"' for name in ("fa", "fb", "fc", "fd")]
    assert tell(configuration(tmp_path, *trusting), lie, 2, 60).outside()


# -- the liar is named


def is_empty_by_enumeration(supports: Sequence[Support]) -> bool:
    """Whether a joint linear program of all sets is infeasible, by HiGHS: no code of this project."""
    bodies = [support.to_constrained_zonotope().arrays for support in supports]
    n, sizes = bodies[0][0].size, [G.shape[1] for _, G, _, _ in bodies]
    rows, sides = [], []
    offsets = n + np.concatenate([[0], np.cumsum(sizes)])
    for (c, G, A, b), start, stop in zip(bodies, offsets, offsets[1:], strict=False):
        on_set, within = np.zeros((n, offsets[-1])), np.zeros((len(b), offsets[-1]))
        on_set[:, :n], on_set[:, start:stop], within[:, start:stop] = np.eye(n), -G, A
        rows += [on_set, within]
        sides += [c, b]
    limits = [(None, None)] * n + [(-1.0, 1.0)] * sum(sizes)
    answer = linprog(np.zeros(offsets[-1]), A_eq=np.vstack(rows), b_eq=np.concatenate(sides), bounds=limits)
    return bool(answer.status == 2)


def named_by_enumeration(story: Story) -> int | None:
    """First step at which no three sources with the liar among them have a point in common."""
    for k, posteriors in story.posteriors.items():
        sets = {n: to_support(m.support) for n, m in posteriors.items() if m.status in ("ok", "predicted")}
        if story.liar not in sets or len(sets) < 4:
            continue
        liar = sets.pop(story.liar)
        if all(is_empty_by_enumeration([liar, *pair]) for pair in itertools.combinations(sets.values(), 2)):
            return k
    return None


@pytest.mark.parametrize("lie", ["bias", "drift", "random", "with each"])
def test_the_liar_is_named_as_soon_as_a_search_over_all_subsets_names_it(tmp_path: Path, lie: str) -> None:
    widen = [f'filters.{name}.on_inconsistency="widen"' for name in ("fa", "fb", "fc", "fd")]
    story = tell(configuration(tmp_path, *widen), lie, 4, 60, liar="fc")
    searched = named_by_enumeration(story)
    assert searched is not None
    assert story.named("fc")[0] <= searched
    assert set(story.about("source-rejected")) == {"fc"}


def test_a_liar_whom_everybody_agrees_with_is_not_named(tmp_path: Path) -> None:
    story = tell(configuration(tmp_path), "with all", 3, 60)
    assert named_by_enumeration(story) is None
    assert story.named(story.liar) == []


# -- quarantine and recovery


def test_a_liar_that_stops_is_let_back_in_and_health_names_it_meanwhile(tmp_path: Path) -> None:
    widen = [f'filters.{name}.on_inconsistency="widen"' for name in ("fa", "fb", "fc", "fd")]
    story = tell(configuration(tmp_path, *widen), "bias", 3, 150, liar="fc")
    assert set(story.about("quarantined")) == {"fc"} == set(story.about("let-back-in"))
    into, out = ([e.step for e in story.events if e.code == code] for code in ("quarantined", "let-back-in"))
    assert into[0] in story.lying
    assert out[-1] >= story.lying.stop
    assert story.fused[into[0]].quarantined == ["fc"]
    assert story.fused[150].quarantined == []
    named = [k for k, reasons in story.complaints.items() if "quarantined: fc" in reasons]
    assert named
    assert all(into[0] <= k < out[-1] for k in named)


@pytest.mark.parametrize(("lie", "seed"), [("bias", 0), ("bias", 3), ("drift", 3), ("random", 2), ("stuck", 1)])
def test_a_fusion_that_believed_a_liar_recovers(tmp_path: Path, lie: str, seed: int) -> None:
    """The lie makes the filter contradict itself; it resets in a new epoch, and the fusion leaves the old one too."""
    trusting = ['fusion.main.policy="intersect"', "fusion.main.faults=0"]
    trusting += [f"filters.{name}.reset_after=2" for name in ("fa", "fb", "fc", "fd")]
    story = tell(configuration(tmp_path, *trusting), lie, seed, 120, liar="fc")
    believed = story.outside()
    assert believed
    assert max(believed) < story.lying.stop + 12
    assert max(fused.epoch for fused in story.fused.values()) > 0
