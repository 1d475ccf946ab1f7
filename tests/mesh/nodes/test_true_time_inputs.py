"""Data between the steps that see jumping inputs, by feedthrough or time error, mixed with transfers."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from exact_course import Course, Scene
from local_mesh import boot
from msgspec import structs
from timed_mesh import Misses, TimedMesh, body, play, report

from lsu_mesh import LSUModel, Orthotope
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Input, Measurement, Message, encode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.verification import verify

SECOND, MS = 10**9, 10**6
DT, STEPS, FEEDTHROUGH, R, RHO = SECOND // 10, 30, 2.0, 0.5, 0.5
MORE = """
[sensors.b]
C = [[1.0, 0.0]]
r = [0.5]
[filters.box]
kind = "LSUO"
sensors = ["a"]
transfer = "predictor"
transfer_from = ["cz"]
[filters.cz]
kind = "LSUCZ"
sensors = ["a", "b"]
transfer = "predictor"
transfer_from = ["box"]
[filters.para]
kind = "LSUPB"
sensors = ["b"]
transfer = "fused"
transfer_from = ["main"]
[fusion.main]
sources = ["box", "cz", "para"]
"""


class Driven:
    """A body whose input jumps at the steps, up to ``delay_ns`` late, under a noise that switches at random."""

    def __init__(self, seed: int, delay_ns: int = 0, *, anywhere: bool = False) -> None:
        rng = np.random.default_rng(seed)
        self.u = [float(v) for v in rng.choice([-5.0, 5.0], STEPS + 12)]
        self._times = [k * DT + (int(rng.choice([0, delay_ns])) if delay_ns else 0) for k in range(STEPS + 12)]
        if anywhere:
            self._times = [k * DT + int(rng.integers(0, delay_ns + 1)) for k in range(STEPS + 12)]
        noise = sorted({0, *(int(v) for v in rng.integers(0, (STEPS + 12) * DT, 60))})
        signs = [Fraction(RHO) * int(v) for v in rng.choice([-1, 1], len(noise))]
        moments = sorted({*self._times, *noise})
        total = [self.acting(t) + signs[bisect_right(noise, t) - 1] for t in moments]
        self.course = Course([Fraction(0), Fraction(1)], moments, total)

    def acting(self, time_ns: int) -> Fraction:
        """The input that acts from a moment on."""
        return Fraction(self.u[max(0, bisect_right(self._times, time_ns) - 1)])

    def begins(self, k: int) -> int:
        """When the input of step k begins to act."""
        return self._times[k]

    def scene(self) -> Scene:
        flow = LSUModel.continuous(
            [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [RHO], [R], noise_map=[[0.0], [1.0]]
        )
        return Scene(flow, Orthotope([0.0, 0.0], [1.0, 1.0]), self.course, [], np.zeros((0, 1)))


def made(path: Path, driven: Driven, error_ns: int, delay_ns: int = 0) -> Configuration:
    read = body(path, driven.scene(), dt=0.1, more=MORE, D=((FEEDTHROUGH,),), time_error_ns=error_ns)
    return replace(read, input_box=Orthotope([-5.0], [5.0]), input_delay_ns=delay_ns)


def traffic(configuration: Configuration, driven: Driven, seed: int, error_ns: int) -> list[tuple[int, Message]]:
    """Inputs of all steps, and reports at random moments, at steps, and just before and after them."""
    rng = np.random.default_rng(seed + 100)
    sent: list[tuple[int, Message]] = [
        (k * DT, Input(v=1, src="plant/plant", boot=boot(1), seq=k, step=k, sent_ns=k * DT, origin_ns=k * DT,
                       model=configuration.digest(), u=[driven.u[k]]))
        for k in range(1, STEPS + 10)
    ]  # fmt: skip
    for name in ("a", "b"):
        near = [k * DT + int(rng.integers(-2 * MS, 2 * MS)) for k in range(3, STEPS, 3)]
        times = sorted({*(k * DT for k in range(2, STEPS, 4)), *near, *rng.integers(2 * DT, STEPS * DT, 20).tolist()})
        for i, t in enumerate(times):
            sent.append((t + MS, at(configuration, driven, name, seq=i, time_ns=t, error_ns=error_ns, rng=rng)))
    return sent


def at(configuration: Configuration, driven: Driven, name: str, *, seq: int, time_ns: int, error_ns: int,
       rng: np.random.Generator) -> Measurement:  # fmt: skip
    """A report whose stamp errs by exactly ± error_ns, and whose noise is at its bound."""
    true = time_ns + int(rng.choice([-1, 1])) * error_ns
    output = driven.course.at(true)[0] + Fraction(FEEDTHROUGH) * driven.acting(true)
    y = float(output + int(rng.choice([-1, 1])) * Fraction(R))
    while abs(Fraction(y) - output) > Fraction(R):
        y = float(np.nextafter(y, float(output)))
    return report(configuration, name, seq, time_ns=time_ns, y=[y], error_ns=error_ns)


def run(configuration: Configuration, sent: list[tuple[int, Message]]) -> TimedMesh:
    mesh = TimedMesh(configuration)
    play(mesh, sent, until_ns=(STEPS + 12) * DT, tick_ns=DT // 4)
    return mesh


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("error_ms", "delay_ms"), [(0, 0), (5, 0), (0, 30), (5, 30)])
def test_no_set_misses_and_all_are_recomputed(tmp_path: Path, error_ms: int, delay_ms: int, seed: int) -> None:
    driven = Driven(seed, delay_ms * MS)
    configuration = made(tmp_path / "driven.toml", driven, error_ms * MS, delay_ms * MS)
    mesh = run(configuration, traffic(configuration, driven, seed, error_ms * MS))
    seen = Misses().look(mesh, driven.course.at)
    assert seen.sets > 4 * (STEPS - 2)
    assert seen.outside == 0
    assert mesh.events("contradiction") == []
    found = verify(configuration, [message for _, message in mesh.sent])
    assert (found.differences, found.false_claims, found.unverifiable) == ([], [], [])
    transferred = [r for name in ("box", "para") for one in mesh.posteriors(name) for r in one.used]
    assert {r[0] for r in transferred} >= {"prediction", "fused", "measurement", "input"}


@pytest.mark.parametrize("error_ms", [0, 5])
def test_sets_verify_where_the_box_drives_a_step_after_one_whose_input_is_known(tmp_path: Path, error_ms: int) -> None:
    """The input before may still act, and nothing else is brought to the set: no data come for some steps."""
    lost, silent = {9, 10, 15, 22}, {*range(9, 13), 16, *range(22, 25)}
    driven = Driven(3, 30 * MS)
    configuration = made(tmp_path / "driven.toml", driven, error_ms * MS, 30 * MS)
    grid = configuration.grid
    sent = [
        (t, message)
        for t, message in traffic(configuration, driven, 3, error_ms * MS)
        if not (message.step in lost if isinstance(message, Input) else grid.step_of(message.time_ns) in silent)  # type: ignore[attr-defined]
    ]
    mesh = run(configuration, sent)
    assert Misses().look(mesh, driven.course.at).outside == 0
    alone = [
        one for one in mesh.posteriors("main") if [r[0] for r in one.used] == ["input"] and one.status == "predicted"
    ]
    assert {one.step for one in alone} >= {10, 23}, "a step of which nothing but the input before is known"
    found = verify(configuration, [message for _, message in mesh.sent])
    assert (found.differences, found.false_claims, found.unverifiable) == ([], [], [])


@pytest.mark.parametrize("error_ms", [0, 5])
def test_inputs_that_come_late_end_in_the_same_sets(tmp_path: Path, error_ms: int) -> None:
    driven = Driven(7)
    configuration = made(tmp_path / "driven.toml", driven, error_ms * MS)
    filters = {name: replace(one, transfer="off", deadline=0.05) for name, one in configuration.filters.items()}
    configuration = replace(configuration, filters=filters)
    sent = traffic(configuration, driven, 7, error_ms * MS)
    rng = np.random.default_rng(1)
    late = [(t + int(rng.integers(0, 8)) * DT if rng.random() < 0.2 else t, message) for t, message in sent]
    supports = []
    for arrivals in (sent, late):
        mesh = run(configuration, arrivals)
        assert Misses().look(mesh, driven.course.at).outside == 0
        supports.append([mesh.newest(name)[k].support for name in filters for k in range(1, STEPS)])
        found = verify(configuration, [message for _, message in mesh.sent])
        assert (found.differences, found.false_claims, found.unverifiable) == ([], [], [])
    assert supports[0] == supports[1]


# -- inputs that say when they begin to act


LONGEST = 80 * MS


def telling(
    configuration: Configuration, driven: Driven, seed: int, share: float = 1.0, early_ns: int = 0
) -> list[tuple[int, Message]]:
    """The traffic in which a share of the inputs say when they begin, up to so much too early."""
    rng = np.random.default_rng(seed)
    sent: list[tuple[int, Message]] = []
    for at_ns, message in traffic(configuration, driven, seed, 0):
        if isinstance(message, Input) and rng.random() < share:
            begins = max(message.step * DT, driven.begins(message.step) - early_ns)
            message = structs.replace(message, time_ns=begins)
        sent.append((at_ns, message))
    return sent


def sized(mesh: TimedMesh) -> float:
    """Mean width of the bounds of all sets, in the end."""
    return float(
        np.mean([np.subtract(one.upper, one.lower) for n in mesh.estimators() for one in mesh.newest(n).values()])
    )


@pytest.mark.parametrize("seed", range(2))
def test_an_input_that_switches_inside_a_step_cuts_the_stretch(tmp_path: Path, seed: int) -> None:
    driven = Driven(seed, LONGEST, anywhere=True)
    configuration = made(tmp_path / "driven.toml", driven, 0, LONGEST)
    widths = []
    for share in (0.0, 0.5, 1.0):
        mesh = run(configuration, telling(configuration, driven, seed, share))
        assert Misses().look(mesh, driven.course.at).outside == 0
        assert mesh.events("contradiction") == []
        found = verify(configuration, [message for _, message in mesh.sent])
        assert (found.differences, found.false_claims, found.unverifiable) == ([], [], [])
        widths.append(sized(mesh))
    assert widths[2] < 0.9 * widths[0]
    assert widths[2] < widths[1] < widths[0], "each moment that is told is worth something"


def test_moments_of_inputs_hold_where_inputs_are_lost_or_late(tmp_path: Path) -> None:
    driven = Driven(4, LONGEST, anywhere=True)
    configuration = made(tmp_path / "driven.toml", driven, 0, LONGEST)
    filters = {name: replace(one, transfer="off", deadline=0.05) for name, one in configuration.filters.items()}
    configuration = replace(configuration, filters=filters)
    lost = {9, 10, 22}
    sent = [one for one in telling(configuration, driven, 4) if not (isinstance(one[1], Input) and one[1].step in lost)]
    rng = np.random.default_rng(2)
    late = [(t + int(rng.integers(0, 8)) * DT if rng.random() < 0.2 else t, message) for t, message in sent]
    supports = []
    for arrivals in (sent, late):
        mesh = run(configuration, arrivals)
        assert Misses().look(mesh, driven.course.at).outside == 0
        supports.append([mesh.newest(name)[k].support for name in filters for k in range(1, STEPS)])
        found = verify(configuration, [message for _, message in mesh.sent])
        assert (found.differences, found.false_claims, found.unverifiable) == ([], [], [])
    assert supports[0] == supports[1]


def test_inputs_that_say_they_began_earlier_than_they_did_are_found(tmp_path: Path) -> None:
    driven = Driven(0, LONGEST, anywhere=True)
    configuration = made(tmp_path / "driven.toml", driven, 0, LONGEST)
    mesh = run(configuration, telling(configuration, driven, 0, early_ns=LONGEST))
    assert Misses().look(mesh, driven.course.at).outside > 0 or mesh.events("contradiction")


@pytest.mark.parametrize(
    ("time_ns", "delay_ms", "continuous", "reason"),
    [
        (3 * DT + 31 * MS, 30, True, "time"),
        (3 * DT - 1, 30, True, "time"),
        (3 * DT + 1, 0, True, "time"),
        (3 * DT + 1, 0, False, "off the grid"),
        (3 * DT + 30 * MS, 30, True, ""),
        (3 * DT, 0, True, ""),
        (3 * DT, 0, False, ""),
    ],
)
def test_an_input_of_a_moment_that_was_not_declared_is_refused_by_name(
    tmp_path: Path, time_ns: int, delay_ms: int, continuous: bool, reason: str
) -> None:
    configuration = made(tmp_path / "driven.toml", Driven(0), 0, delay_ms * MS)
    if not continuous:
        configuration = replace(configuration, continuous=None)
    node = FilterNode(configuration, "para", boot(7))
    message = Input(v=1, src="plant/plant", boot=boot(1), seq=0, step=3, sent_ns=0, origin_ns=0,
                    model=configuration.digest(), u=[1.0], time_ns=time_ns)  # fmt: skip
    node.deliver(key(configuration.mesh.name, "input", "plant"), encode(message), 0)
    assert node.admission.refused == ({reason: 1} if reason else {})
    assert node.admission.received == (0 if reason else 1)
