"""Simulated sensors that measure at moments of their own, with clocks that err, on plants of continuous models."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.config.settings import ScheduledModel
from lsu_mesh.mesh.messages import Measurement, Truth
from lsu_mesh.mesh.nodes.plant import PlantNode
from lsu_mesh.mesh.nodes.plant_course import PlantCourse
from lsu_mesh.mesh.nodes.schedule import Schedule
from lsu_mesh.mesh.nodes.sensor import SimulatedSensorNode
from lsu_mesh.mesh.nodes.sensor_clock import SensorClock
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import simulate

MESH = """
[mesh]
name = "own"
dt = 0.1
start_time = 50.0
rate = 10.0
steps = 100
seed = 7
[model]
A = [[1.0, 0.1], [0.0, 1.0]]
B = [[0.0], [0.1]]
rho = [0.1, 0.1]
[model.prior]
lower = [-10.0, -10.0]
upper = [10.0, 10.0]
[sensors.gauge]
C = [[1.0, 0.0]]
r = [0.5]
[filters.box]
kind = "LSUO"
sensors = ["gauge"]
"""
MS = 10**6
FLOW = LSUModel.continuous(
    [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.zeros((0, 2)), [2.0], [], noise_map=[[0.0], [1.0]]
)


@pytest.fixture
def base(tmp_path: Path) -> Configuration:
    (tmp_path / "mesh.toml").write_text(MESH)
    return dataclasses.replace(load(tmp_path / "mesh.toml", ()), continuous=FLOW)


def with_sensor(base: Configuration, **changes: object) -> Configuration:
    gauge = dataclasses.replace(base.sensors["gauge"], **changes)  # type: ignore[arg-type]
    return dataclasses.replace(base, sensors={"gauge": gauge})


def truths(configuration: Configuration) -> list[Truth]:
    plant = PlantNode(configuration, "plant", "0" * 16, Schedule(0, 1000.0))
    return [m for now in range(0, 2 * 10**10, 10**8) for m in plant.tick(now) if isinstance(m, Truth)]


def measured(configuration: Configuration, given: Sequence[Truth] | None = None) -> list[Measurement]:
    """What the sensor says to these truths, by default to all of them in order."""
    sensor = SimulatedSensorNode(configuration, "gauge", "1" * 16)
    sensor.warm_up()
    given = truths(configuration) if given is None else given
    return [m for truth in given for m in sensor.receive(truth, 0) if isinstance(m, Measurement)]


def exact_position(configuration: Configuration, time_ns: int) -> Fraction:
    """The position of the double integrator at a moment, in rationals from the truth of the step before."""
    k = configuration.grid.step_of(time_ns + 1) - 1
    course, seed = PlantCourse(configuration), configuration.mesh.seed
    from lsu_mesh.simulation import NOISE_SHARE, random_uniform

    x = next(truth.x for truth in truths(configuration) if truth.step == k)
    late = course.delay_ns(k)
    noise = Fraction(2.0 * NOISE_SHARE * random_uniform(seed, "plant/process", k, 1)[0])
    since = time_ns - configuration.grid.time_of(k)
    position, velocity = map(Fraction, x)
    for u, h in ((course.input(k - 1), min(late, since)), (course.input(k), max(0, since - late))):
        a, t = Fraction(float(u[0])) + noise, Fraction(h, 10**9)
        position, velocity = position + velocity * t + a * t * t / 2, velocity + a * t
    return position


def test_the_plant_of_a_continuous_model_is_the_library_s_simulation(base: Configuration) -> None:
    course = PlantCourse(base)
    inputs = np.array([course.input(k) for k in range(1, 101)])
    dt_ns = 100 * MS
    x, found = course.first, [course.first]
    for k in range(1, 20):
        x = course.next(k, x)
        found.append(x)
    assert [truth.x for truth in truths(base)][:20] == [one.tolist() for one in found]
    reference = simulate(FLOW, 100, 0, x1=course.first, inputs=inputs, dt_ns=dt_ns)
    without_noise = dataclasses.replace(base, continuous=FLOW.replace(rho=[0.0]))
    assert truths(without_noise)[1].x == pytest.approx(
        simulate(FLOW.replace(rho=[0.0]), 2, 0, x1=course.first, inputs=inputs[:2], dt_ns=dt_ns).X[1], abs=0
    )
    assert reference.X.shape == (100, 2)


def test_a_clock_without_faults_says_every_multiple_of_its_period(base: Configuration) -> None:
    found = measured(with_sensor(base, every_ns=35 * MS))
    start = base.grid.start_ns
    expected = [start + i * 35 * MS for i in range(1, 400) if base.grid.time_of(1) <= start + i * 35 * MS]
    assert [m.time_ns for m in found] == [t for t in expected if t <= base.grid.time_of(100)]
    assert all(m.step == base.grid.step_of(m.time_ns) and m.time_error_ns == 0 for m in found)


@pytest.mark.parametrize("delay", [0, 30 * MS])
def test_the_outputs_are_those_of_the_true_moment_and_keep_the_bound(base: Configuration, delay: int) -> None:
    configuration = with_sensor(
        dataclasses.replace(base, input_delay_ns=delay), every_ns=70 * MS, jitter_ns=20 * MS, clock_error_ns=5 * MS,
        time_error_ns=5 * MS,
    )  # fmt: skip
    clock = SensorClock(configuration.sensors["gauge"], configuration.grid, configuration.mesh.seed)
    moments = {m.stamp_ns: m for m in clock.between(configuration.grid.time_of(1), configuration.grid.time_of(101))}
    found = measured(configuration)
    assert len(found) > 100
    noise, off = [], []
    for message in found[::7]:
        moment = moments[message.time_ns]
        y = message.y[0]
        assert y is not None
        noise.append(float(Fraction(y) - exact_position(configuration, moment.time_ns)))
        off.append(moment.time_ns - message.time_ns)
        assert message.time_error_ns == 5 * MS
    assert max(map(abs, noise)) <= 0.5 + 1e-12
    assert max(map(abs, noise)) > 0.3, "the noise uses its bounds"
    assert max(map(abs, off)) <= 5 * MS
    assert max(off) > 2 * MS > -2 * MS > min(off), "the clock errs to both sides"


def test_jitter_comes_after_the_turn(base: Configuration) -> None:
    settings = with_sensor(base, every_ns=50 * MS, jitter_ns=20 * MS).sensors["gauge"]
    moments = SensorClock(settings, base.grid, 3).between(base.grid.time_of(1), base.grid.time_of(50))
    late = [m.time_ns - base.grid.start_ns - m.number * 50 * MS for m in moments]
    assert 0 <= min(late) < 3 * MS < 17 * MS < max(late) < 20 * MS
    assert all(m.stamp_ns == m.time_ns for m in moments)
    assert [m.number for m in moments] == list(range(moments[0].number, moments[-1].number + 1))


def test_any_split_of_time_finds_the_same_moments(base: Configuration) -> None:
    settings = with_sensor(base, every_ns=30 * MS, jitter_ns=100 * MS).sensors["gauge"]
    clock, t = SensorClock(settings, base.grid, 3), base.grid.time_of
    whole = clock.between(t(1), t(40))
    pieces = [m for k in range(1, 40) for m in clock.between(t(k), t(k) + 1) + clock.between(t(k) + 1, t(k + 1))]
    assert pieces == whole


def test_what_was_measured_does_not_hang_on_the_order_of_truths(base: Configuration) -> None:
    configuration = with_sensor(base, every_ns=35 * MS, jitter_ns=40 * MS, clock_error_ns=3 * MS, time_error_ns=3 * MS)
    given = truths(configuration)
    orderly = {(m.time_ns, m.y[0]) for m in measured(configuration, given)}
    shuffled = [given[i] for i in np.random.default_rng(1).permutation(len(given))]
    assert {(m.time_ns, m.y[0]) for m in measured(configuration, shuffled)} == orderly
    again = {(m.time_ns, m.y[0]) for m in measured(configuration, given[40:])}
    assert again < orderly, "a sensor that starts late says the same of what it saw"
    twice = measured(configuration, [*given, *given])
    assert len(twice) == len(orderly)


def test_a_sensor_on_the_grid_says_the_integer_moment(base: Configuration) -> None:
    thirds = dataclasses.replace(base, mesh=dataclasses.replace(base.mesh, exact_dt=Fraction(1, 30)))
    found = measured(with_sensor(thirds, time_error_ns=2 * MS))
    assert [(m.step, m.time_ns) for m in found] == [(k, thirds.grid.time_of(k)) for k in range(1, 101)]
    assert {m.time_error_ns for m in found} == {2 * MS}


def test_feedthrough_sees_the_input_of_the_moment_and_angles_are_wrapped(base: Configuration) -> None:
    course = PlantCourse(base)
    thrown = with_sensor(base, D=((1.0,),), offset=(3.0,), C=((0.0, 0.0),), r=(0.0,))
    assert [m.y[0] for m in measured(thrown)] == [float(course.input(k)[0] + 3.0) for k in range(1, 101)]
    own = dataclasses.replace(thrown.sensors["gauge"], every_ns=50 * MS)
    between = measured(dataclasses.replace(thrown, sensors={"gauge": own}))
    for message in between:
        k = base.grid.step_of(message.time_ns + 1) - 1
        assert message.y[0] == float(course.input(k)[0] + 3.0), "inside a step the input of its begin acts"
    wrapped = measured(with_sensor(base, period=(2.0,), r=(0.0,)))
    assert all(m.y[0] is not None and -1.0 <= m.y[0] < 1.0 for m in wrapped)


def test_a_discrete_plant_moves_on_a_line_between_its_steps(base: Configuration) -> None:
    discrete = with_sensor(dataclasses.replace(base, continuous=None), every_ns=50 * MS, r=(0.0,))
    x = {truth.step: truth.x[0] for truth in truths(discrete)}
    found = {m.time_ns: m.y[0] for m in measured(discrete)}
    for k in range(1, 100):
        assert found[base.grid.time_of(k)] == x[k]
        assert found[base.grid.time_of(k) + 50 * MS] == pytest.approx(0.5 * (x[k] + x[k + 1]))


def test_a_schedule_changes_the_plant(base: Configuration) -> None:
    still = FLOW.replace(A=[[0.0, 0.0], [0.0, 0.0]], B=[[0.0], [0.0]], rho=[0.0])
    changed = dataclasses.replace(base, schedule=(ScheduledModel(10, still),))
    x, before = [truth.x for truth in truths(changed)], [truth.x for truth in truths(base)]
    assert x[:10] == before[:10]
    assert all(one == x[9] for one in x[9:])
    frozen = LSUModel(np.eye(2), np.zeros((2, 1)), np.zeros((0, 2)), [0.0, 0.0], [])
    discrete = dataclasses.replace(base, continuous=None, schedule=(ScheduledModel(10, frozen),))
    x = [truth.x for truth in truths(discrete)]
    assert x[8] != x[9]
    assert all(one == x[9] for one in x[9:])


def test_the_delay_of_an_input_lies_within_what_is_declared(base: Configuration) -> None:
    late = PlantCourse(dataclasses.replace(base, input_delay_ns=10 * MS))
    delays = [late.delay_ns(k) for k in range(1, 300)]
    assert delays[0] == 0, "no input is known before the first"
    assert max(delays) <= 10 * MS
    assert max(delays) > 9 * MS
    assert min(delays[1:]) < MS
    longer = PlantCourse(dataclasses.replace(base, input_delay_ns=500 * MS))
    assert max(longer.delay_ns(k) for k in range(1, 50)) == 100 * MS, "no longer than a step"
