"""Models that change at a step or at a moment, through whole meshes: no set misses the exact state."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from exact_course import Course
from local_mesh import boot
from msgspec import structs
from timed_mesh import Misses, TimedMesh, play, report

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.estimation.step_data import ACROSS_MODELS
from lsu_mesh.mesh.messages import Input, Message
from lsu_mesh.mesh.verification import verify
from lsu_mesh.model import LSUModel
from lsu_mesh.testing.exact_plant import Exact, next_state

SECOND, MS = 10**9, 10**6
DT, STEPS = SECOND // 10, 40
CHANGES = (12, 25)
START = 1_600_000_000 * SECOND
"""2020-09-13T12:26:40Z."""
MESH = """
[mesh]
name = "scheduled"
dt = 0.1
start_time = 1600000000
[model]
{model}
[model.prior]
lower = [-1.0, -1.0]
upper = [1.0, 1.0]
[model.domain]
lower = [-1000.0, -1000.0]
upper = [1000.0, 1000.0]
[sensors.a]
C = [[1.0, 0.0]]
r = [0.25]
[sensors.b]
C = [[0.0, 1.0]]
r = [0.5]
[filters.box]
kind = "LSUO"
sensors = ["a", "b"]
[filters.para]
kind = "LSUPB"
sensors = ["a"]
transfer = "fused"
transfer_from = ["main"]
[filters.cz]
kind = "LSUCZ"
sensors = ["a", "b"]
transfer = "predictor"
transfer_from = ["box"]
[fusion.main]
sources = ["box", "cz", "para"]
"""
FLOW = """
continuous = true
A = [[0.0, 1.0], [0.0, 0.0]]
noise_map = [[0.0], [1.0]]
rho = [0.5]
[[model.schedule]]
from = {first}
offset = [0.0, 9.0]
[[model.schedule]]
from = {second}
offset = [0.0, -9.0]
rho = [2.0]
"""
PUSH = (Fraction(0), Fraction(9), Fraction(-9))
BOUND = (Fraction(1, 2), Fraction(1, 2), Fraction(2))
STEPPED = """
A = [[1.0, 0.1], [0.0, 1.0]]
B = [[0.0], [0.1]]
rho = [0.01, 0.05]
[[model.schedule]]
from = {first}
A = [[0.9, 0.3], [-0.3, 0.9]]
offset = [0.5, 0.0]
[[model.schedule]]
from = {second}
B = [[0.1], [-0.2]]
rho = [0.02, 0.2]
"""
MOMENTS = ('"2020-09-13T12:26:41.2Z"', "2020-09-13T12:26:42.5Z")
"""Those of the two steps, as a text and as a date."""


def time_of(k: int) -> int:
    return START + k * DT


def made(path: Path, model: str, first: object = CHANGES[0], second: object = CHANGES[1]) -> Configuration:
    path.write_text(MESH.format(model=model.format(first=first, second=second)))
    return load(path)


def near(exact: Fraction, r: float, sign: int) -> float:
    y = float(exact + sign * Fraction(r))
    while abs(Fraction(y) - exact) > Fraction(r):
        y = float(np.nextafter(y, float(exact)))
    return y


def course(seed: int) -> Course:
    """From t_1 on: the push of the model in force, and a noise at its bounds that switches at random."""
    rng = np.random.default_rng(seed)
    moments = sorted({time_of(1), *map(time_of, CHANGES), *(START + int(v) for v in rng.integers(DT, STEPS * DT, 60))})
    force = [sum(t >= time_of(k) for k in CHANGES) for t in moments]
    noise = [int(v) for v in rng.choice([-1, 1], len(moments))]
    total = [PUSH[i] + sign * BOUND[i] for i, sign in zip(force, noise, strict=True)]
    return Course([Fraction(1, 2), Fraction(-1, 2)], moments, total)


def reports(configuration: Configuration, state, times: dict[str, list[int]], seed: int, error_ns: int = 0):  # type: ignore[no-untyped-def]
    rng, sent = np.random.default_rng(seed), []
    for i, (name, listed) in enumerate(sorted(times.items())):
        for seq, t in enumerate(listed):
            x = state(t + int(rng.choice([-1, 1])) * error_ns)[i]
            y = near(x, configuration.sensors[name].r[0], int(rng.choice([-1, 1])))
            sent.append((t + MS, report(configuration, name, seq, time_ns=t, y=[y], error_ns=error_ns, number=i)))
    return sent


def irregular(seed: int, per_sensor: int = 60) -> dict[str, list[int]]:
    """Random moments, each change itself, and those just before and after it."""
    rng = np.random.default_rng(seed)
    near_changes = [time_of(k) + off for k in CHANGES for off in (-2 * MS, 0, 2 * MS)]
    return {
        name: sorted({*near_changes, *(START + int(v) for v in rng.integers(2 * DT, STEPS * DT, per_sensor))})
        for name in ("a", "b")
    }


def run(configuration: Configuration, sent: list[tuple[int, Message]]) -> TimedMesh:
    mesh = TimedMesh(configuration)
    mesh.now = START
    play(mesh, sent, until_ns=time_of(STEPS + 10), tick_ns=DT // 4)
    return mesh


def check(mesh: TimedMesh, state) -> None:  # type: ignore[no-untyped-def]
    seen = Misses().look(mesh, state)
    assert seen.sets >= 4 * (STEPS - 3)
    assert seen.outside == 0
    for code in ("contradiction", "reset", "epoch-left", "transfer-rejected"):
        assert [event.text for event in mesh.events(code)] == []
    found = verify(mesh.configuration, [message for _, message in mesh.sent])
    assert (found.differences, found.false_claims, found.unverifiable) == ([], [], [])


@pytest.mark.parametrize("seed", range(2))
def test_a_continuous_model_changes_at_a_step(tmp_path: Path, seed: int) -> None:
    configuration, truth = made(tmp_path / "flow.toml", FLOW), course(seed)
    mesh = run(configuration, reports(configuration, truth.at, irregular(seed), seed))
    check(mesh, truth.at)


def test_an_error_of_time_across_the_change_is_counted_and_not_used(tmp_path: Path) -> None:
    configuration, truth = made(tmp_path / "flow.toml", FLOW), course(3)
    error, times = 3 * MS, irregular(3)
    configuration = replace(
        configuration,
        sensors={name: replace(one, time_error_ns=error) for name, one in configuration.sensors.items()},
    )
    mesh = run(configuration, reports(configuration, truth.at, times, 3, error))
    check(mesh, truth.at)
    across = [
        sum(any(t - error < time_of(k) <= t + error for k in CHANGES) for t in times[name]) for name in ("a", "b")
    ]
    assert min(across) >= 4
    assert mesh.nodes["box"].counters()[ACROSS_MODELS] == sum(across)
    assert mesh.nodes["para"].counters()[ACROSS_MODELS] == across[0]


def stepped(configuration: Configuration, seed: int) -> tuple[list[Exact], list[tuple[int, Message]]]:
    """Exact states of the steps 1, 2, … with the model of each, and the messages of the inputs."""
    rng = np.random.default_rng(seed)
    later = configuration.schedule
    models = [configuration.base_model, *(entry.model for entry in later)]
    x, sent = [[Fraction(1, 2), Fraction(-1, 2)]], []
    for k in range(1, STEPS + 10):
        model = models[sum(k >= entry.first for entry in later)]
        assert isinstance(model, LSUModel)
        u = float(rng.choice([-4.0, 4.0]))
        noise = [Fraction(int(v)) for v in rng.choice([-1, 1], 2)]
        moved = next_state(model, x[-1], np.array([u]), rho=model.rho, noise=noise)
        offset = np.zeros(2) if model.a is None else model.a
        x.append([value + Fraction(more) for value, more in zip(moved, offset.tolist(), strict=True)])
        t = time_of(k)
        sent.append((t, Input(v=1, src="plant/plant", boot=boot(1), seq=k, step=k, sent_ns=t, origin_ns=t,
                              model=configuration.digest(), u=[u])))  # fmt: skip
    return x, sent


@pytest.mark.parametrize("seed", range(2))
def test_a_discrete_model_changes_at_a_step(tmp_path: Path, seed: int) -> None:
    configuration = made(tmp_path / "stepped.toml", STEPPED)
    x, inputs = stepped(configuration, seed)

    def state(time_ns: int) -> Exact:
        return x[(time_ns - START) // DT - 1]

    times = {name: [time_of(k) for k in range(1, STEPS)] for name in ("a", "b")}
    mesh = run(configuration, [*inputs, *reports(configuration, state, times, seed)])
    check(mesh, state)


@pytest.mark.parametrize("model", [FLOW, STEPPED], ids=["continuous", "discrete"])
def test_a_change_at_a_moment_is_one_at_its_step(tmp_path: Path, model: str) -> None:
    steps = made(tmp_path / "steps.toml", model)
    moments = made(tmp_path / "moments.toml", model, *MOMENTS)
    assert [entry.first for entry in moments.schedule] == list(CHANGES)
    assert moments.digest() == steps.digest()


@pytest.mark.parametrize("model", [FLOW, STEPPED], ids=["continuous", "discrete"])
def test_a_schedule_that_is_a_step_late_is_found(tmp_path: Path, model: str) -> None:
    """What the tests above would show if a node changed its model a step late."""
    true, wrong = made(tmp_path / "true.toml", model), made(tmp_path / "wrong.toml", model, first=CHANGES[0] + 1)
    wrong = replace(wrong, sensors={name: replace(one, r=(1e-3,)) for name, one in wrong.sensors.items()})
    if true.continuous is not None:
        state, sent, times = course(0).at, [], irregular(0)
    else:
        x, inputs = stepped(true, 0)
        sent = [(at, structs.replace(message, model=wrong.digest())) for at, message in inputs]
        times = {name: [time_of(k) for k in range(1, STEPS)] for name in ("a", "b")}

        def state(time_ns: int) -> Exact:
            return x[(time_ns - START) // DT - 1]

    mesh = run(wrong, [*sent, *reports(wrong, state, times, 0)])
    assert mesh.events("contradiction")
