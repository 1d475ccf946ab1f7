"""Angles that wrap, feedthrough off the grid, and several data of a step, through nodes and against exact states."""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from exact_course import scene
from local_mesh import boot
from timed_mesh import Misses, TimedMesh, body, play, report

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.estimation.step_data import ACROSS_MODELS, AT_A_START, BEFORE_PRIOR, NO_INPUT, ONE_PER_STEP
from lsu_mesh.mesh.messages import Input, Measurement, Message
from lsu_mesh.mesh.verification import verify
from lsu_mesh.testing.exact_plant import Exact, next_state

SECOND, MS = 10**9, 10**6
DT, STEPS = SECOND // 10, 40
TURN = Fraction(360)
ALARMS = ("contradiction", "reset", "reset-impossible", "epoch-left", "epoch-lost", "transfer-rejected")
LINE = """
[mesh]
name = "line"
dt = 0.1
start_time = 0
[model]
A = [[1.0, 0.1], [0.0, 1.0]]
B = [[0.0], [0.1]]
rho = [0.01, 0.05]
[model.prior]
lower = [-1.0, -1.0]
upper = [1.0, 1.0]
[model.input_box]
lower = [-4.0]
upper = [4.0]
[sensors.a]
C = [[1.0, 0.0]]
r = [0.5]
[sensors.b]
C = [[0.0, 1.0]]
r = [0.25]
[filters.box]
kind = "LSUO"
sensors = ["a", "b"]
[filters.para]
kind = "LSUPB"
sensors = ["a"]
[filters.cz]
kind = "LSUCZ"
sensors = ["a", "b"]
[fusion.main]
sources = ["box", "cz", "para"]
"""


class Motion(NamedTuple):
    """Exact states of the steps 1, 2, …, and the inputs that drive them on."""

    x: list[Exact]
    u: list[float]

    def at(self, time_ns: int) -> Exact:
        """On a straight line between two steps."""
        k, since = divmod(time_ns, DT)
        if not since:
            return self.x[k - 1]
        share = Fraction(since, DT)
        return [a + share * (z - a) for a, z in zip(self.x[k - 1], self.x[k], strict=True)]

    def acting(self, time_ns: int) -> Fraction:
        """The input that acts from a moment on."""
        return Fraction(self.u[time_ns // DT - 1])


def motion(configuration: Configuration, seed: int, speed: float = 0.5) -> Motion:
    rng, model = np.random.default_rng(seed), configuration.base_model
    x, u = [[Fraction(1, 3), Fraction(speed)]], []
    for _ in range(STEPS + 10):
        u.append(float(rng.choice([-4.0, 4.0])))
        noise = [Fraction(int(v)) for v in rng.choice([-1, 1], 2)]
        x.append(next_state(model, x[-1], np.array(u[-1:]), rho=model.rho, noise=noise))
    return Motion(x, u)


def near(exact: Fraction, r: float, sign: int) -> float:
    """The double next to ``exact ± r`` that is not farther from ``exact`` than r."""
    y = float(exact + sign * Fraction(r))
    while abs(Fraction(y) - exact) > Fraction(r):
        y = float(np.nextafter(y, float(exact)))
    return y


def inputs(configuration: Configuration, moved: Motion, lost: tuple[int, ...] = ()) -> list[tuple[int, Message]]:
    return [
        (k * DT, Input(v=1, src="plant/plant", boot=boot(1), seq=k, step=k, sent_ns=k * DT, origin_ns=k * DT,
                       model=configuration.digest(), u=[moved.u[k - 1]]))
        for k in range(1, STEPS + 8) if k not in lost
    ]  # fmt: skip


def run(configuration: Configuration, sent: list[tuple[int, Message]]) -> TimedMesh:
    mesh = TimedMesh(configuration)
    play(mesh, sent, until_ns=(STEPS + 10) * DT, tick_ns=DT // 4)
    return mesh


def alarms(mesh: TimedMesh) -> list[str]:
    return [event.text for code in ALARMS for event in mesh.events(code)]


def check(mesh: TimedMesh, state, *, least: int) -> None:  # type: ignore[no-untyped-def]
    """No set misses the exact state, nothing contradicts, and every set is made again bit by bit."""
    seen = Misses().look(mesh, state)
    assert seen.sets >= least
    assert seen.outside == 0
    assert alarms(mesh) == []
    found = verify(mesh.configuration, [message for _, message in mesh.sent])
    assert (found.differences, found.false_claims, found.unverifiable) == ([], [], [])


# -- angles


def wrapped(exact: Fraction, r: float, sign: int) -> float:
    """What a compass says: a true report of the angle in [0, 360)."""
    turns = (exact + sign * Fraction(r)) // TURN
    return near(exact - turns * TURN, r, sign)


def compass(path: Path, seed: int, *, continuous: bool, period: float = 360.0):  # type: ignore[no-untyped-def]
    """A body that turns, 60° or 130° a second: its mesh, its exact states, and what the compass says of them."""
    rng = np.random.default_rng(seed)
    if continuous:
        made = scene(seed, speed=60.0, acceleration=2.0, r=0.5, apart=(0.15, 0.5), rows=40)
        configuration, state, times = body(path, made, dt=0.1), made.course.at, made.times
    else:
        path.write_text(LINE)
        configuration = load(path)
        moved = motion(configuration, seed, speed=130.0)
        state, times = moved.at, [k * DT for k in range(1, STEPS)]
        prior = configuration.prior
        configuration = replace(configuration, prior=type(prior)([-1.0, 129.0], [1.0, 131.0]))
    turning = {name: replace(one, period=(period,)) if name == "a" else one
               for name, one in configuration.sensors.items()}  # fmt: skip
    configuration = replace(configuration, sensors=turning)
    said = [wrapped(state(t)[0], 0.5, int(rng.choice([-1, 1]))) for t in times]
    sent: list[tuple[int, Message]] = [
        (t + MS, report(configuration, "a", i, time_ns=t, y=[y]))
        for i, (t, y) in enumerate(zip(times, said, strict=True))
    ]
    return configuration, state, sent if continuous else [*inputs(configuration, moved), *sent], said


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("continuous", [True, False], ids=["continuous", "discrete"])
def test_an_angle_that_wraps_is_no_contradiction(tmp_path: Path, seed: int, continuous: bool) -> None:
    configuration, state, sent, said = compass(tmp_path / "compass.toml", seed, continuous=continuous)
    drops = [(a, b) for a, b in itertools.pairwise(said) if a - b > 300]
    assert drops, "the compass has passed 360"
    mesh = TimedMesh(configuration)
    play(mesh, sent, until_ns=sent[-1][0] + 2 * SECOND, tick_ns=DT // 2)
    check(mesh, state, least=3 * len(said))
    widths = [one.upper[0] - one.lower[0] for one in mesh.posteriors("main") if one.used]
    assert max(widths[3:]) < 360.0, "each report is of one turn alone"


def test_without_the_period_the_same_reports_contradict(tmp_path: Path) -> None:
    configuration, _, sent, _ = compass(tmp_path / "compass.toml", 0, continuous=False, period=0.0)
    assert alarms(run(configuration, sent))


# -- several data of a step, off the grid, with feedthrough


def driven(path: Path, *, feedthrough: float, speed: float = 0.5) -> tuple[Configuration, Motion]:
    """The mesh of LINE with the exact largest |dy/dt| of its motion as rates."""
    path.write_text(LINE)
    read = load(path)
    moved = motion(read, 3, speed)
    sensors = {}
    for i, name in enumerate(("a", "b")):
        steepest = max(abs(z[i] - a[i]) for a, z in itertools.pairwise(moved.x)) * SECOND / DT
        rate = float(np.nextafter(float(steepest), np.inf))
        D = ((feedthrough,),) if feedthrough and name == "a" else ()
        sensors[name] = replace(read.sensors[name], rate=(rate,), D=D)
    return replace(read, sensors=sensors), moved


def irregular(
    configuration: Configuration, moved: Motion, error_ns: int, per_step: float, seed: int = 0
) -> list[tuple[int, Measurement]]:
    """True reports at random moments, whose stamps err by exactly ± error_ns and whose noise is at its bounds."""
    rng, sent = np.random.default_rng(seed), []
    for i, (name, sensor) in enumerate(sorted(configuration.sensors.items())):
        times = sorted({int(v) for v in rng.integers(2 * DT, STEPS * DT, round(per_step * STEPS))})
        for seq, t in enumerate(times):
            true = t + int(rng.choice([-1, 1])) * error_ns
            exact = moved.at(true)[i]
            if sensor.D:
                exact += Fraction(sensor.D[0][0]) * moved.acting(true)
            y = near(exact, sensor.r[0], int(rng.choice([-1, 1])))
            sent.append((t + MS, report(configuration, name, seq, time_ns=t, y=[y], error_ns=error_ns, number=i)))
    return sent


@pytest.mark.parametrize("error_ms", [0, 5])
@pytest.mark.parametrize("per_step", [0.6, 3.0])
def test_a_rate_holds_with_feedthrough_and_several_data_of_a_step(
    tmp_path: Path, per_step: float, error_ms: int
) -> None:
    configuration, moved = driven(tmp_path / "line.toml", feedthrough=2.0)
    measured = irregular(configuration, moved, error_ms * MS, per_step)
    mesh = run(configuration, [*inputs(configuration, moved), *measured])
    check(mesh, moved.at, least=4 * (STEPS - 2))
    used = {reference for one in mesh.posteriors("box") for reference in one.used}
    unused = {message.reference for _, message in measured} - used
    assert len(unused) < 0.1 * len(measured), "only late ones that change no set are not told of"
    for name in configuration.filters:
        node = mesh.nodes[name]
        assert not {BEFORE_PRIOR, AT_A_START, ACROSS_MODELS, NO_INPUT, ONE_PER_STEP} & set(node.counters())
        assert not node.admission.refused
    assert {one.guarantee for one in mesh.posteriors("main")} == {"declared"}


def test_a_feedthrough_that_was_not_told_is_found(tmp_path: Path) -> None:
    """The same reports, of a sensor that is said to see no input: they contradict."""
    configuration, moved = driven(tmp_path / "line.toml", feedthrough=2.0)
    said = irregular(configuration, moved, 0, 3.0)
    silent = replace(configuration, sensors={name: replace(one, D=()) for name, one in configuration.sensors.items()})
    told = [(at, report(silent, m.name, m.seq, time_ns=m.time_ns, y=m.y, number=m.name == "b")) for at, m in said]
    assert alarms(run(silent, [*inputs(silent, moved), *told]))


@pytest.mark.parametrize("lost", [(), (9, 10, 21)], ids=["all inputs", "three inputs lost"])
def test_the_order_in_which_they_come_does_not_matter(tmp_path: Path, lost: tuple[int, ...]) -> None:
    configuration, moved = driven(tmp_path / "line.toml", feedthrough=2.0)
    measured = irregular(configuration, moved, 0, 2.5)
    rng = np.random.default_rng(5)
    late = [(at + int(rng.integers(0, 6)) * DT if rng.random() < 0.3 else at, message) for at, message in measured]
    final = []
    for arrivals in (measured, late):
        mesh = run(configuration, [*inputs(configuration, moved, lost), *arrivals])
        check(mesh, moved.at, least=3 * (STEPS - 2))
        final.append([mesh.newest(name)[k].support for name in configuration.filters for k in range(1, STEPS)])
    assert final[0] == final[1]


@pytest.mark.parametrize("feedthrough", [0.0, 2.0])
def test_one_false_report_among_several_of_a_step_is_named_and_left_out(tmp_path: Path, feedthrough: float) -> None:
    configuration, moved = driven(tmp_path / "line.toml", feedthrough=feedthrough)
    measured = irregular(configuration, moved, 0, 3.0)
    false = report(configuration, "a", 999, time_ns=20 * DT - 7 * MS, y=[50.0], number=0)
    check_named(configuration, moved, measured, false, told_by={"filter/box", "filter/cz", "filter/para"})


def test_a_false_report_is_left_out_where_the_sensor_that_sees_the_input_is_silent(tmp_path: Path) -> None:
    configuration, moved = driven(tmp_path / "line.toml", feedthrough=2.0)
    step = range(19 * DT + 1, 20 * DT + 1)
    measured = [one for one in irregular(configuration, moved, 0, 1.0) if one[1].time_ns not in step]
    false = report(configuration, "b", 999, time_ns=20 * DT - 7 * MS, y=[50.0], number=1)
    check_named(configuration, moved, measured, false, told_by={"filter/box", "filter/cz"})


def check_named(
    configuration: Configuration, moved: Motion, measured: list[tuple[int, Measurement]], false: Measurement,
    *, told_by: set[str],
) -> None:  # fmt: skip
    """The false report alone is left out, by all who have it, and no set misses the exact state for it."""
    mesh = run(configuration, [*inputs(configuration, moved), *measured, (false.time_ns + MS, false)])
    events = mesh.events("contradiction")
    assert {event.src for event in events} == told_by
    assert {(event.step, event.about["sensor"]) for event in events} == {(20, false.name)}
    assert Misses().look(mesh, moved.at).outside == 0
    found = verify(configuration, [message for _, message in mesh.sent])
    assert (found.differences, found.false_claims, found.unverifiable) == ([], [], [])
