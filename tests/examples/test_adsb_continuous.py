"""The altitude of aircraft in continuous time: reports of an age, and what the page says of the flight."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from exact_course import Course, inside
from flights import convert_module, flight

from lsu_mesh import LSUCZ, LSUPB, InconsistentData
from lsu_mesh.filters.held_inputs import HeldInputs
from lsu_mesh.filters.timed_data import TimedDatum, carry, cut
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Event, Measurement, Posterior, encode
from lsu_mesh.mesh.nodes.file_sensor import FileSensorNode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.schedule import Schedule

SECOND = 10**9
CELL, ACCELERATION = 25, 8
REPORTS = 2930


class Run(NamedTuple):
    """What a filter node makes of the file."""

    posteriors: dict[int, Posterior]
    contradictions: list[Event]
    measured: list[Measurement]


def run(configuration: Configuration, name: str) -> Run:
    """The file's sensor and one filter, as fast as they can."""
    sensor = FileSensorNode(configuration, "baro", "0" * 16, Schedule(0, configuration.mesh.rate))
    node = FilterNode(configuration, name, "1" * 16)
    found = Run({}, [], [])
    now = 0
    while not sensor.finished or now < 10**9:
        now += 10**7
        for message in sensor.tick(now):
            if isinstance(message, Measurement):
                found.measured.append(message)
                node.deliver(sensor.key(message), encode(message), now)
        take(found, node.tick(now))
    take(found, node.tick(now + 10 * SECOND))
    assert not node.admission.refused
    return found


def take(found: Run, messages: list) -> None:  # type: ignore[type-arg]
    for message in messages:
        if isinstance(message, Posterior):
            found.posteriors[message.step] = message
        elif isinstance(message, Event) and message.code == "contradiction":
            found.contradictions.append(message)


# -- a flight that is known exactly


def invented(folder: Path, seed: int, seconds: int) -> tuple[Path, Course]:
    """A flight with ± 8 ft/s² all the time; reports up to 1.6 s old in cells of 25 ft, in rows as convert.py's."""
    rng = np.random.default_rng(seed)
    ends, now, speed = [0], 0, Fraction(0)
    signs = []
    while now < (seconds + 2) * SECOND:
        length = int(rng.integers(SECOND // 4, 3 * SECOND))
        sign = int(rng.choice([-1, 1])) if abs(speed) < 60 else (-1 if speed > 0 else 1)
        speed += Fraction(ACCELERATION * sign * length, SECOND)
        now += length
        signs.append(sign)
        ends.append(now)
    course = Course([Fraction(3000), Fraction(0)], ends[:-1], [Fraction(ACCELERATION * sign) for sign in signs])
    rows = ["time,measured,altitude"]
    for k in range(2, seconds):
        age = int(rng.choice([0, 1_600_000_000, int(rng.integers(0, 1_600_000_001))]))
        altitude = CELL * round(course.at(k * SECOND - age)[0] / CELL)
        rows.append(f"{k},{k - 0.8:.1f},{altitude if rng.random() < 0.7 else ''}")
    (folder / "flight.csv").write_text("\n".join(rows) + "\n")
    return folder / "flight.csv", course


@pytest.mark.parametrize("name", ["para", "cz"])
@pytest.mark.parametrize("seed", range(2))
def test_every_set_of_a_known_flight_holds_the_altitude_and_the_climb_rate(
    root: Path, tmp_path: Path, seed: int, name: str
) -> None:
    file, course = invented(tmp_path, seed, seconds=150)
    changes = [f'sensors.baro.file="{file}"', "mesh.start_time=0.0"]
    configuration = load(root / "examples" / "adsb" / "continuous.toml", changes)
    found = run(configuration, name)
    assert found.contradictions == []
    assert len(found.posteriors) >= 125
    for k, one in found.posteriors.items():
        truth = course.at(configuration.grid.time_of(k))
        assert inside(np.array(one.lower), np.array(one.upper), truth), k
        assert one.guarantee == "declared"
    widths = np.array([np.subtract(one.upper, one.lower) for one in found.posteriors.values()])
    assert np.median(widths[:, 0]) < 400.0, "the reports say something"


def test_reports_that_are_older_than_declared_are_found(root: Path, tmp_path: Path) -> None:
    file, _ = invented(tmp_path, 0, seconds=150)
    changes = [f'sensors.baro.file="{file}"', "mesh.start_time=0.0", 'sensors.baro.time_error="0s"']
    assert run(load(root / "examples" / "adsb" / "continuous.toml", changes), "cz").contradictions


# -- what README.md and docs/decisions/0001 say of the flight


@pytest.fixture(scope="module")
def aircraft_carrier(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Configuration:
    """``continuous.toml`` with the flight, as run.py would start it; a skip where it cannot be fetched."""
    steps = flight(root, tmp_path_factory.mktemp("adsb"), convert_module(root), "aircraft_carrier")
    file = steps.sensors["baro"].file
    assert file is not None
    changes = [f'sensors.baro.file="{file.path}"', f"mesh.start_time={steps.mesh.start_time}"]
    return load(root / "examples" / "adsb" / "continuous.toml", changes)


@pytest.mark.parametrize("name", ["para", "cz"])
def test_no_set_of_the_flight_is_empty_with_an_age_of_1_6_seconds(aircraft_carrier: Configuration, name: str) -> None:
    found = run(aircraft_carrier, name)
    assert found.contradictions == []
    told = [message for message in found.measured if message.y != [None]]
    assert len(told) == REPORTS
    assert {message.time_error_ns for message in told} == {800_000_000}
    assert len(found.posteriors) == max(found.posteriors) > 11_400
    assert {one.status for one in found.posteriors.values()} == {"ok", "predicted"}
    used = {reference for one in found.posteriors.values() for reference in one.used}
    late = [message for message in told if message.reference not in used]
    grid = aircraft_carrier.grid
    assert all(message.time_ns - 800_000_000 < grid.time_of(1) for message in late), "all but those before the prior"


def widths_at_reports(configuration: Configuration, made: type[LSUCZ] | type[LSUPB], half_ns: int) -> tuple[int, list]:  # type: ignore[type-arg]
    """Reports left out, and median widths at the others, where the interval of a report ends with its second."""
    flow, outputs, nothing = configuration.continuous, configuration.outputs("baro"), HeldInputs.constant()
    file = configuration.sensors["baro"].file
    assert flow is not None
    assert file is not None
    filter, now, left_out, widths = made(configuration.model(["baro"]), configuration.prior), 0, 0, []
    for row in file.path.read_text().splitlines()[1:]:
        second, _, altitude = row.split(",")
        if not altitude:
            continue
        at = int(second) * SECOND - half_ns
        if now:
            carry(filter, flow, now, end_ns=at, inputs=nothing)
        now = at
        try:
            cut(filter, flow, TimedDatum(at, np.array([float(altitude)]), half_ns, outputs), nothing)
        except InconsistentData:
            left_out += 1
            continue
        widths.append(np.subtract(*reversed(filter.bounds())))
    return left_out, np.median(widths, axis=0).tolist()


@pytest.mark.parametrize(
    ("half_ms", "left_out", "altitude", "climb_rate"),
    [(500, 4, 82, 72), (700, 1, 116, 85), (800, 0, 136, 92), (1000, 0, 182, 107)],
)
def test_the_widths_are_those_of_the_page(
    aircraft_carrier: Configuration, half_ms: int, left_out: int, altitude: int, climb_rate: int
) -> None:
    found, widths = widths_at_reports(aircraft_carrier, LSUCZ, half_ms * 1_000_000)
    assert found == left_out
    assert widths == [pytest.approx(altitude, abs=1.0), pytest.approx(climb_rate, abs=1.5)]
