"""The altitude of real aircraft: which reports are new, what the model holds, and what filters make of it."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from flights import convert_module, flight
from hypothesis import example, given
from hypothesis import strategies as st

from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.fusion.fuse import fuse
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Event, Measurement, Posterior, encode
from lsu_mesh.mesh.nodes.file_sensor import FileSensorNode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.schedule import Schedule

CELL = 25.0
ROUNDING = 1e-9
START_UP = 10
PIECES = 8
"""The acceleration is constant over a quarter of a second."""


@pytest.fixture(scope="module")
def convert(root: Path) -> ModuleType:
    return convert_module(root)


@pytest.fixture(scope="module")
def aircraft_carrier(root: Path, tmp_path_factory: pytest.TempPathFactory, convert: ModuleType) -> Configuration:
    return flight(root, tmp_path_factory.mktemp("adsb"), convert, "aircraft_carrier")


@pytest.fixture(scope="module")
def noisy_landing(root: Path, tmp_path_factory: pytest.TempPathFactory, convert: ModuleType) -> Configuration:
    return flight(root, tmp_path_factory.mktemp("adsb"), convert, "noisy_landing")


@pytest.fixture
def configuration(root: Path, tmp_path: Path) -> Configuration:
    """The example's configuration with a file of one row."""
    (tmp_path / "one.csv").write_text("time,measured,altitude\n1600120071,1600120070.2,0\n")
    return load(root / "examples" / "adsb" / "adsb.toml", [f'sensors.baro.file="{tmp_path / "one.csv"}"'])


def test_a_repeated_state_vector_is_no_report(convert: ModuleType) -> None:
    rows = [(50.0, 1.0, 2.0), (50.0, 1.0, 2.0), (50.0, 1.1, 2.0), (None, None, None), (75.0, 1.1, 2.0)]
    vectors = [
        {"timestamp": 1000 * k, "altitude": altitude, "latitude": latitude, "longitude": longitude}
        for k, (altitude, latitude, longitude) in enumerate(rows)
    ]
    assert list(convert.new_reports(vectors)) == [(0.0, 50.0), (1.0, None), (2.0, 50.0), (3.0, None), (4.0, 75.0)]


@given(
    accelerations=st.lists(st.fractions(-8, 8), min_size=PIECES, max_size=PIECES),
    speed=st.fractions(-134, 134),
    ages=st.tuples(st.fractions(0, 1), st.fractions(0, 1)),
)
@example([Fraction(8)] * 8, Fraction(134), (Fraction(0), Fraction(1)))  # |V| = a
@example([Fraction(8)] * 4 + [Fraction(-8)] * 4, Fraction(0), (Fraction(1), Fraction(0)))  # |D| = a/4
@example([Fraction(0)] * 8, Fraction(-150), (Fraction(0), Fraction(1)))  # |G| = v_max/2
def test_the_model_holds_every_motion_and_every_age_of_a_report(
    accelerations: list[Fraction], speed: Fraction, ages: tuple[Fraction, Fraction]
) -> None:
    """In exact numbers: two seconds of motion, and x+ − A x inside noise_map [−rho, rho]."""
    a_max, v_max = Fraction(8), Fraction(150)
    quarter = Fraction(1, 4)
    speeds, heights = [speed], [Fraction(0)]
    for a in accelerations:
        heights.append(heights[-1] + speeds[-1] * quarter + a * quarter**2 / 2)
        speeds.append(speeds[-1] + a * quarter)
    assert max(map(abs, speeds)) <= v_max

    def height(t: Fraction) -> Fraction:
        piece = min(int(t / quarter), PIECES - 1)
        rest = t - piece * quarter
        return heights[piece] + speeds[piece] * rest + accelerations[piece] * rest**2 / 2

    half = Fraction(1, 2)
    states = []
    for second, age in zip((1, 2), ages, strict=True):
        reported, middle = height(second - age), height(second - half)
        states.append((reported, speeds[int((second - half) / quarter)], reported - middle))
    (h, v, g), (h_next, v_next, g_next) = states
    V = v_next - v
    D = h_next - g_next - (h - g) - v - V / 2
    assert abs(V) <= a_max
    assert abs(D) <= a_max / 4
    assert abs(g_next) <= v_max / 2


def test_the_configuration_has_the_numbers_that_hold_every_motion(configuration: Configuration) -> None:
    model = configuration.model(["baro"])
    a_max, v_max = 8.0, 150.0
    assert model.rho.tolist() == [a_max, a_max / 4, v_max / 2]
    h, v, g, V, D, G = 1000.0, 20.0, 7.0, 3.0, 1.0, -11.0
    assert model.noise_map is not None
    after = model.A @ [h, v, g] + model.noise_map @ [V, D, G]
    assert after.tolist() == [h - g + v + V / 2 + D + G, v + V, G]
    assert model.C.tolist() == [[1.0, 0.0, 0.0]]
    assert model.r.tolist() == [CELL / 2]
    assert model.domain is not None
    assert model.domain.upper[1:].tolist() == [v_max, v_max / 2]


def test_every_report_of_the_aircraft_carrier_flight_is_explained_within_its_cell(
    aircraft_carrier: Configuration,
) -> None:
    file = aircraft_carrier.sensors["baro"].file
    assert file is not None
    reports = reported(file.path)
    assert len(reports) == 2930
    engines = {name: made(aircraft_carrier, name) for name in ("box", "para", "cz")}
    for k in range(1, max(reports) + 1):
        if k in reports:
            for engine in engines.values():
                engine.update([reports[k]])  # raises InconsistentData on a contradiction
            fused = fuse([engine.support for engine in engines.values()])
            widths = {name: engine.bounds()[1][0] - engine.bounds()[0][0] for name, engine in engines.items()}
            widths["fused"] = fused.bounds[1][0] - fused.bounds[0][0]
            if k > START_UP:
                assert max(widths["box"], widths["cz"], widths["fused"]) <= CELL + ROUNDING, (k, widths)
        for engine in engines.values():
            engine.predict()


@pytest.mark.parametrize("name", ["box", "cz"])
def test_wrong_reports_become_events_and_the_run_goes_on(noisy_landing: Configuration, name: str) -> None:
    file = noisy_landing.sensors["baro"].file
    assert file is not None
    reports = reported(file.path)
    absurd = {k for k, altitude in reports.items() if abs(altitude - around(reports, k)) > 10_000}
    assert len(absurd) >= 3
    sensor = FileSensorNode(noisy_landing, "baro", "0" * 16, Schedule(0, noisy_landing.mesh.rate))
    node = FilterNode(noisy_landing, name, "1" * 16)
    posteriors: dict[int, Posterior] = {}
    named: set[int] = set()
    for now in range(0, 10**10, 10**7):
        for measured in sensor.tick(now):
            if isinstance(measured, Measurement):
                node.deliver(sensor.key(measured), encode(measured), now)
        for message in node.tick(now):
            if isinstance(message, Posterior):
                posteriors[message.step] = message
            elif isinstance(message, Event) and message.code == "contradiction":
                assert message.about["sensor"] == "baro"
                named.add(message.step)
    assert max(posteriors) == max(reports)
    assert absurd <= named
    assert len(posteriors) == max(reports)
    assert {k for k, message in posteriors.items() if message.status == "inconsistent"} <= named


def made(configuration: Configuration, name: str) -> Filter:
    settings = configuration.filters[name]
    return filter_class(settings.kind)(configuration.model(["baro"]), configuration.prior, **settings.options)  # type: ignore[call-arg]


def reported(file: Path) -> dict[int, float]:
    """Reports by step; the first row is step 1."""
    rows = [line.split(",") for line in file.read_text().splitlines()[1:]]
    first = float(rows[0][0])
    return {round(float(time) - first) + 1: float(altitude) for time, _, altitude in rows if altitude}


def around(reports: dict[int, float], k: int) -> float:
    """Median of the reports near a step."""
    return float(np.median([altitude for j, altitude in reports.items() if abs(j - k) <= 10]))
