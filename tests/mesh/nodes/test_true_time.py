"""Measurements at moments of their own, through whole meshes: no set misses the exact state, nothing contradicts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_course import Scene, scene
from timed_mesh import Misses, TimedMesh, body, play, report

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Measurement
from lsu_mesh.mesh.verification import verify

SECOND, MS = 10**9, 10**6


def car(seed: int, rows: int = 40, clock_ns: int = 0) -> Scene:
    return scene(seed, speed=20.0, acceleration=1.0, r=0.5, apart=(0.15, 0.5), rows=rows, clock_ns=clock_ns)


def ferry(seed: int, rows: int = 25) -> Scene:
    return scene(seed, speed=8.0, acceleration=0.05, r=5.0, apart=(2.0, 10.0), rows=rows)


def reports(configuration: Configuration, made: Scene, error_ns: int = 0) -> list[tuple[int, Measurement]]:
    return [
        (t + 10 * MS, report(configuration, "a", i, time_ns=t, y=made.Y[i].tolist(), error_ns=error_ns))
        for i, t in enumerate(made.times)
    ]


def check_verified(configuration: Configuration, mesh: TimedMesh) -> None:
    found = verify(configuration, [message for _, message in mesh.sent])
    assert (found.differences, found.false_claims, found.unverifiable) == ([], [], [])
    assert found.exact.total() > 0


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("made_of", "dt"), [(car, 0.1), (ferry, 2.0)], ids=["car", "ferry"])
def test_a_body_that_reports_irregularly_is_held_by_every_set(tmp_path: Path, made_of, dt: float, seed: int) -> None:  # type: ignore[no-untyped-def]
    made = made_of(seed)
    configuration = body(tmp_path / "body.toml", made, dt=dt)
    mesh = TimedMesh(configuration)
    sent = reports(configuration, made)
    play(mesh, sent, until_ns=made.times[-1] + round(10 * dt * SECOND), tick_ns=round(dt / 4 * SECOND))
    seen = Misses().look(mesh, made.course.at)
    last = configuration.grid.step_of(made.times[-1])
    assert seen.sets >= 6 * (last - 1)
    assert seen.outside == 0
    assert mesh.events("contradiction") == []
    for name in configuration.filters:
        used = {reference for one in mesh.posteriors(name) for reference in one.used}
        assert {message.reference for _, message in sent} <= used, "every report counts"
    check_verified(configuration, mesh)


@pytest.mark.parametrize("seed", range(2))
def test_clocks_that_err_by_as_much_as_declared_cost_no_set(tmp_path: Path, seed: int) -> None:
    made = car(seed, clock_ns=5 * MS)
    configuration = body(tmp_path / "car.toml", made, dt=0.1, time_error_ns=5 * MS)
    mesh = TimedMesh(configuration)
    play(mesh, reports(configuration, made, 5 * MS), until_ns=made.times[-1] + SECOND, tick_ns=25 * MS)
    seen = Misses().look(mesh, made.course.at)
    assert seen.sets > 0
    assert seen.outside == 0
    assert mesh.events("contradiction") == []
    check_verified(configuration, mesh)


def test_clocks_that_err_more_than_declared_lead_to_named_contradictions(tmp_path: Path) -> None:
    made = car(0, clock_ns=60 * MS)
    configuration = body(tmp_path / "car.toml", made, dt=0.1)
    mesh = TimedMesh(configuration)
    play(mesh, reports(configuration, made), until_ns=made.times[-1] + SECOND, tick_ns=25 * MS)
    events = mesh.events("contradiction")
    assert events
    event = events[0]
    assert event.about["sensor"] == "a"
    assert event.about["time_ns"] in made.times
    assert f"at {event.about['time_ns']} ns" in event.text
    alone = [one for one in events if one.about["gap"] is not None]
    assert all(one.about["gap"] > 0 for one in alone)  # type: ignore[operator]
    check_verified(configuration, mesh)


# -- the order of arrival does not matter

THREE = """
[sensors.b]
C = [[1.0, 0.0]]
r = [0.5]
[sensors.c]
C = [[0.0, 1.0]]
r = [0.5]
[filters.box]
kind = "LSUO"
sensors = ["a", "b", "c"]
[filters.cz]
kind = "LSUCZ"
sensors = ["a", "c"]
[fusion.main]
sources = ["box", "cz"]
"""


def three_sensors(configuration: Configuration, made: Scene, seconds: float) -> list[tuple[int, Measurement]]:
    """100 Hz, 7 Hz and irregular, over steps of 0.1 s."""
    rng = np.random.default_rng(3)
    ends = round(seconds * SECOND)
    times = {
        "a": list(range(SECOND // 10 + 10 * MS, ends, 10 * MS)),
        "b": [SECOND // 10 + round(i * SECOND / 7) for i in range(1, round(7 * seconds))],
        "c": sorted({int(v) for v in rng.integers(SECOND // 10 + 1, ends, 3)}),
    }
    sent = []
    for name, listed in times.items():
        for i, t in enumerate(t for t in listed if t < ends):
            x = made.course.at(t)[name == "c"]
            y = float(x) + float(rng.uniform(-0.49, 0.49))
            sent.append((t + 5 * MS, report(configuration, name, i, time_ns=t, y=[y])))
    return sent


def shuffled(sent: list[tuple[int, Measurement]], seed: int, late: float, by_ns: int) -> list[tuple[int, Measurement]]:
    rng = np.random.default_rng(seed)
    return [(at + int(rng.integers(0, by_ns)) if rng.random() < late else at, message) for at, message in sent]


def test_late_and_shuffled_data_end_in_the_same_sets_bit_by_bit(tmp_path: Path) -> None:
    made = car(1)
    configuration = body(tmp_path / "three.toml", made, dt=0.1, more=THREE)
    filters = {name: replace(one, deadline=0.2) for name, one in configuration.filters.items()}
    configuration = replace(configuration, filters=filters)
    sent = three_sensors(configuration, made, seconds=2.5)
    final = []
    for arrivals in (sent, shuffled(sent, 1, late=0.2, by_ns=SECOND), shuffled(sent, 2, late=1.0, by_ns=2 * SECOND)):
        mesh = TimedMesh(configuration)
        play(mesh, arrivals, until_ns=6 * SECOND, tick_ns=50 * MS)
        assert Misses().look(mesh, made.course.at).outside == 0
        assert mesh.events("contradiction") == []
        last = configuration.grid.step_of(max(message.time_ns for _, message in sent))
        sets = {name: mesh.newest(name) for name in mesh.estimators()}
        final.append({(name, k): sets[name][k].support for name in configuration.filters for k in range(1, last + 1)})
        for k in range(1, last + 1):
            of_step = {m.reference for _, m in sent if configuration.grid.step_of(m.time_ns) == k}
            # a late one that cuts nothing off changes nothing that was told
            assert arrivals is not sent or of_step <= {*sets["box"][k].used}
        check_verified(configuration, mesh)
    assert final[0] == final[1]
    assert final[0] == final[2]
