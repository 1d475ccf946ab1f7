"""The events of a step in order: jumping inputs, feedthrough, time errors across a step's end, transfers, a domain."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from exact_course import SECOND, Course, inside

from lsu_mesh import LSUCZ, LSUO, LSUP, LSUPB, Filter, LSUModel, Orthotope, ZonotopicKalman
from lsu_mesh.filters.grid import step_of
from lsu_mesh.filters.held_inputs import HeldInputs
from lsu_mesh.filters.timed_data import TimedDatum, bring, contradicting, cut

STEPS, SOAK_STEPS = 60, 100_000
DT = SECOND // 10
CLOCK_NS = 20_000_000
R, RHO = 0.05, 0.5
FLOW = LSUModel.continuous(
    [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [RHO], [R], [[0.0], [1.0]],
    domain=([-1e6, -50.0], [1e6, 50.0]),
)  # fmt: skip
SENSORS = {
    "odometer": FLOW.rates.replace(D=[[0.5]], d=[2.0]),
    "heading": FLOW.rates.replace(period=2.0, outputs=["phase"]),
    "speed": FLOW.rates.replace(C=[[0.0, 1.0]], r=[0.3], outputs=["v"]),
}
OFFSET = {"odometer": Fraction(2), "heading": Fraction(0), "speed": Fraction(0)}


def course(rng: np.random.Generator, steps: int) -> tuple[Course, HeldInputs]:
    """Steps 1 … of DT; the input jumps at each, the noise within them; the speed is kept small by the input."""
    switches, accelerations, inputs = [], [], []
    speed = Fraction(0)
    for k in range(steps + 2):
        u = Fraction(float(rng.choice([-4.0, 4.0]))) if abs(speed) < 10 else Fraction(-4 if speed > 0 else 4)
        inputs.append(np.array([float(u)]))
        inner = DT // 2 + int(rng.integers(-DT // 4, DT // 4))
        for start, length in ((k * DT, inner), (k * DT + inner, DT - inner)):
            w = Fraction(RHO) * int(rng.choice([-1, 1]))
            switches.append(start)
            accelerations.append(u + w)
            speed += (u + w) * Fraction(length, SECOND)
    return Course([Fraction(0), Fraction(0)], switches, accelerations), HeldInputs(
        [k * DT for k in range(steps + 2)], inputs
    )


def report(rng: np.random.Generator, truth: Course, inputs: HeldInputs, steps: int) -> TimedDatum:
    """A sensor's datum, in error by exactly ± r, of a moment up to CLOCK_NS from its stamp."""
    name = str(rng.choice(list(SENSORS)))
    error = int(rng.choice([0, CLOCK_NS]))
    near_the_end = bool(rng.random() < 0.4)  # the error reaches across the end of a step
    t = int(rng.integers(2, steps)) * DT + int(
        rng.integers(-CLOCK_NS, CLOCK_NS + 1) if near_the_end else rng.integers(DT)
    )
    moment = t + int(rng.integers(-error, error + 1))
    x, u, outputs = truth.at(moment), inputs.at(moment), SENSORS[name]
    value = sum((Fraction(c) * v for c, v in zip(outputs.C[0].tolist(), x, strict=True)), OFFSET[name])
    if outputs.D is not None:
        value += Fraction(float(outputs.D[0, 0])) * Fraction(float(u[0]))  # type: ignore[index]
    exact = value + Fraction(float(outputs.r[0])) * Fraction(99_999_999, 10**8) * int(rng.choice([-1, 1]))
    if outputs.period is not None:
        exact -= 2 * ((exact + 1) // 2)
    return TimedDatum(t, np.array([float(exact)]), error, outputs, sensor=name)


def run(made: type[Filter], seed: int, steps: int) -> int:
    """Steps whose set misses the truth, or whose true data are contradicted."""
    rng = np.random.default_rng(seed)
    truth, inputs = course(rng, steps)
    data: dict[int, list[TimedDatum]] = {}
    for _ in range(2 * steps):
        datum = report(rng, truth, inputs, steps)
        data.setdefault(step_of(datum.time_ns, 0, DT), []).append(datum)
    start = np.array([float(v) for v in truth.at(DT)])
    filter = made(FLOW.discretised(DT), Orthotope(start - 0.3, start + 0.3))  # type: ignore[call-arg]
    missed = 0
    for k in range(2, steps):
        before, now, events = (k - 1) * DT, k * DT, data.get(k, [])
        missed += contradicting(filter, FLOW, events, before, inputs) != []
        assert bring(filter, FLOW, [d for d in events if d.time_ns < now], before, now, inputs) == []
        if rng.random() < 0.2:  # what another filter knows of x(t_k)
            x = np.array([float(v) for v in truth.at(now)])
            filter.condition(Orthotope(x - rng.random(2) - 1e-6, x + rng.random(2) + 1e-6))
        for datum in (d for d in events if d.time_ns == now):
            cut(filter, FLOW, datum, inputs)
        missed += not inside(*filter.bounds(), truth.at(now))
    return missed


@pytest.mark.parametrize("made", [LSUO, LSUP, LSUPB, LSUCZ, ZonotopicKalman])
def test_every_set_holds_the_exact_truth(made: type[Filter]) -> None:
    assert [run(made, seed, STEPS) for seed in range(3)] == [0, 0, 0]


@pytest.mark.soak
@pytest.mark.timeout(0)
@pytest.mark.parametrize("made", [LSUO, LSUP, LSUPB, LSUCZ])
def test_every_set_holds_the_exact_truth_in_full(made: type[Filter]) -> None:
    length = 200
    assert sum(run(made, seed, length) for seed in range(SOAK_STEPS // length // 4)) == 0
