"""Plants and sensors: the same values after a restart, faults as configured, files played step by step."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lsu_mesh.mesh.messages import Input, Measurement, Truth

MakeMesh = Callable[..., Any]

FILE_MESH = """
[mesh]
name = "filed"
dt = 0.5
start_time = 100.0

[model]
A = [[1.0, 0.5], [0.0, 1.0]]
rho = [0.1, 0.1]
[model.prior]
lower = [-10.0, -10.0]
upper = [10.0, 10.0]

[sensors.gauge]
C = [[1.0, 0.0]]
r = [0.5]
file = "gauge.csv"
time = "t"
columns = ["height"]

[filters.box]
kind = "LSUO"
sensors = ["gauge"]
"""


def test_a_plant_that_starts_again_is_at_the_current_step_with_the_same_values(mesh_of: MakeMesh) -> None:
    orderly = mesh_of("mesh.steps=400")
    orderly.run(8.1, tick_ms=20)
    mesh = mesh_of("mesh.steps=400")
    mesh.run(1.0, tick_ms=20)
    mesh.kill("plant")
    mesh.run(5.0, tick_ms=20)
    plant = mesh.start("plant", "plant")
    mesh.run(2.1, tick_ms=20)
    assert mesh.truth()[400] == orderly.truth()[400]
    again = [m for m in mesh.of(Truth) if m.boot == plant.boot]
    assert again[0].step == 301, "silent about the past"
    inputs = {m.step: m.u for m in mesh.of(Input) if m.boot == plant.boot}
    assert min(inputs) < 52, "but for the inputs, which every filter needs"
    assert inputs == {k: m.u for k, m in ((m.step, m) for m in orderly.of(Input)) if k in inputs}
    assert max(mesh.newest("main")) == 400


def test_a_plant_that_was_away_for_long_brings_every_input_in_bursts_and_nobody_starts_over(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=2000")
    mesh.run(1.0, tick_ms=20)
    mesh.kill("plant")
    mesh.run(25.0, tick_ms=1000)
    plant = mesh.start("plant", "plant")
    before = len(mesh.sent)
    mesh.turn()
    first = [m for _, m in mesh.sent[before:] if isinstance(m, Input)]
    assert [m.step for m in first] == list(range(1, 65)), "no flood"
    mesh.run(3.0)
    inputs = [m.step for m in mesh.of(Input) if m.boot == plant.boot]
    assert inputs == list(range(1, inputs[-1] + 1)), "oldest first, none left out"
    assert mesh.events("started-over") == []
    truth = mesh.truth()
    for name in mesh.estimators():
        newest = mesh.newest(name)
        assert max(newest) >= 1400
        last = newest[max(newest)]
        assert last.status == "ok"
        assert all(low <= x <= high for low, x, high in zip(last.lower, truth[last.step], last.upper, strict=True))


def test_a_plant_that_was_away_for_hours_still_tells_how_it_does(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=100000")
    for name in [name for name in mesh.nodes if name != "plant"]:
        mesh.kill(name)
    mesh.now = round(60_000 * 0.02 * 1e9)
    mesh.nodes["plant"].tick(mesh.now)
    assert mesh.nodes["plant"].step() == 20_000, "no tick takes for ever"
    mesh.run(1.0)
    assert mesh.truth()
    assert min(m.step for m in mesh.of(Input)) == 60_001 - 1500


def test_a_sensor_that_starts_again_measures_the_same(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=20")
    mesh.run(0.5)
    first = {m.step: m.y for m in mesh.of(Measurement, "s1")}
    sensor = mesh.start("sensor", "s1")
    for address, message in list(mesh.sent):
        if isinstance(message, Truth):
            from lsu_mesh.mesh.messages import encode

            mesh.publish(sensor, sensor.deliver(address, encode(message), mesh.now))
    again = {m.step: m.y for m in mesh.of(Measurement, "s1") if m.boot == sensor.boot}
    assert again == first


def test_measurements_keep_the_declared_half_widths(mesh_of: MakeMesh) -> None:
    mesh = mesh_of("mesh.steps=200")
    mesh.run(4.1, tick_ms=20)
    truth = mesh.truth()
    for name, sensor in mesh.configuration.sensors.items():
        noise = [m.y[0] - np.dot(sensor.C[0], truth[m.step]) for m in mesh.of(Measurement, name)]
        assert np.abs(noise).max() <= 0.3 + 1e-12
        assert np.abs(noise).max() > 0.25, "the noise uses its bounds"


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("bias", lambda y, k, at5: y + 2.0),
        ("drift", lambda y, k, at5: y + 2.0 * (k - 4)),
        ("stuck", lambda y, k, at5: at5),
        ("lost", lambda y, k, at5: None),
    ],
)
def test_a_fault_acts_from_its_first_to_its_last_step(
    mesh_of: MakeMesh, kind: str, expected: Callable[[float, int, float], float | None]
) -> None:
    sound = mesh_of("mesh.steps=10")
    sound.run(0.4)
    faulty = mesh_of("mesh.steps=10", f'sensors.s1.faults=[{{kind="{kind}", from=5, to=7, size=2.0}}]')
    faulty.run(0.4)
    true = {m.step: m.y[0] for m in sound.of(Measurement, "s1")}
    for message in faulty.of(Measurement, "s1"):
        k = message.step
        wanted = expected(true[k], k, true[5]) if 5 <= k <= 7 else true[k]
        assert message.y == ([None] if wanted is None else pytest.approx([wanted], abs=1e-12))


def test_a_file_is_played_by_its_times_and_holes_are_missing(mesh_of: MakeMesh, tmp_path: Path) -> None:
    (tmp_path / "mesh.toml").write_text(FILE_MESH)
    (tmp_path / "gauge.csv").write_text("t,height\n100.5,1.0\n101.0,\n102.5,1.5\n99,3\n")
    mesh = mesh_of(file=tmp_path / "mesh.toml")
    mesh.run(5.0, tick_ms=50)
    played = {m.step: m.y[0] for m in mesh.of(Measurement)}
    assert played == {1: 1.0, 2: None, 3: None, 4: None, 5: 1.5}
    assert mesh.nodes["gauge"].finished
    (event,) = mesh.events("rows-before-the-prior")
    assert event.about["rows"] == 1
    newest = mesh.newest("box")
    assert [newest[k].status for k in range(1, 6)] == ["ok", "predicted", "predicted", "predicted", "ok"]
    assert newest[5].lower[0] >= 1.0 - 1e-9
    assert newest[5].upper[0] <= 2.0 + 1e-9
    assert not any(math.isnan(value) for p in newest.values() for value in p.point)
