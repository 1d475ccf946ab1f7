"""Meshes that go by time keep the invariants under all faults, and those that lie about time are found."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Measurement
from lsu_mesh.mesh.nodes import sensor
from lsu_mesh.mesh.nodes.estimator import Estimator
from lsu_mesh.mesh.simulator import run, variants
from lsu_mesh.mesh.simulator.faults import FAULTS
from lsu_mesh.mesh.simulator.run import Outcome, run_seed
from lsu_mesh.mesh.simulator.time_variants import TIMES, draw_times, timed
from lsu_mesh.mesh.simulator.variants import Variant, configured, draw_variant

STEPS = 60
MAX_SEEDS = 30

CAR = """
[mesh]
name = "car"
dt = 0.1
[model]
continuous = true
A = [[0.0, 1.0], [0.0, 0.0]]
B = [[0.0], [1.0]]
noise_map = [[0.0], [1.0]]
rho = [2.0]
[model.prior]
lower = [-1.0, 18.0]
upper = [1.0, 22.0]
[model.domain]
lower = [-1000.0, -100.0]
upper = [1000.0, 100.0]
[sensors.irregular]
C = [[1.0, 0.0]]
r = [0.5]
every = "150ms"
jitter = "350ms"
clock_error = "5ms"
time_error = "5ms"
[sensors.odometer]
C = [[0.0, 1.0]]
r = [0.2]
every = "142857143ns"
[sensors.fast]
C = [[1.0, 0.0]]
r = [2.0]
every = "10ms"
[filters.box]
kind = "LSUO"
sensors = ["odometer", "fast"]
[filters.para]
kind = "LSUPB"
sensors = ["irregular", "odometer"]
[filters.cz]
kind = "LSUCZ"
sensors = ["irregular", "odometer"]
[fusion.main]
sources = ["box", "para", "cz"]
"""


@pytest.fixture(autouse=True)
def fresh_references() -> Iterator[None]:
    """No configuration and no fault-free run of another way is taken."""
    yield
    run.fault_free_widths.cache_clear()
    variants.configured.cache_clear()


def outcome(file: Path, way: str, seed: int, monkeypatch: pytest.MonkeyPatch, steps: int = STEPS) -> Outcome:
    monkeypatch.setattr(run, "draw_times", lambda rng, base: way)
    return run_seed(file, seed, steps, FAULTS)


@pytest.mark.parametrize("way", TIMES)
def test_no_invariant_is_broken(demo: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    for seed in (2, 5):
        found = outcome(demo, way, seed, monkeypatch)
        assert found.broken == "", found.variant
        assert way in found.variant
        assert found.sets > STEPS


def test_after_the_faults_all_is_as_without_them(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert outcome(demo, "erring clocks", 4, monkeypatch, steps=240).broken == ""


@pytest.mark.soak
@pytest.mark.parametrize("way", TIMES)
def test_no_invariant_is_broken_in_many_seeds(demo: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    assert [one for seed in range(1, 101) if (one := outcome(demo, way, seed, monkeypatch, 240)).broken] == []


def test_a_car_keeps_the_invariants(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "car.toml").write_text(CAR)
    found = [outcome(tmp_path / "car.toml", "", seed, monkeypatch) for seed in (1, 2)]
    assert [one.broken for one in found] == ["", ""]


@pytest.mark.soak
def test_a_car_keeps_the_invariants_in_a_hundred_seeds(tmp_path: Path) -> None:
    (tmp_path / "car.toml").write_text(CAR)
    assert [one for seed in range(1, 101) if (one := run_seed(tmp_path / "car.toml", seed, 240, FAULTS)).broken] == []


def found_in(demo: Path, way: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """What is broken first."""
    for seed in range(1, MAX_SEEDS + 1):
        found = outcome(demo, way, seed, monkeypatch)
        if found.broken:
            return found.broken
    raise AssertionError(f"not found in {MAX_SEEDS} seeds")


def test_clocks_that_err_without_saying_so_are_found(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def silent(configuration: Configuration, way: str) -> Configuration:
        moved = timed(configuration, way)
        wrong = {"time_error_ns": 0, "clock_error_ns": 15 * 10**6, "r": (0.01,)}
        return replace(moved, sensors={name: replace(one, **wrong) for name, one in moved.sensors.items()})  # type: ignore[arg-type]

    monkeypatch.setattr(variants, "timed", silent)
    assert found_in(demo, "erring clocks", monkeypatch).startswith(("containment", "false alarm"))


def test_reports_that_are_put_on_the_nearest_step_are_found(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = sensor.SimulatedSensorNode._measurement

    def on_the_step(self: sensor.SimulatedSensorNode, *arguments: object) -> Measurement:
        message = told(self, *arguments)  # type: ignore[arg-type]
        return structs.replace(message, time_ns=self.configuration.grid.time_of(message.step))

    def narrow(configuration: Configuration, way: str) -> Configuration:
        moved = timed(configuration, way)
        return replace(moved, sensors={n: replace(s, r=(0.01,)) for n, s in moved.sensors.items()})

    monkeypatch.setattr(sensor.SimulatedSensorNode, "_measurement", on_the_step)
    monkeypatch.setattr(variants, "timed", narrow)
    assert found_in(demo, "own moments", monkeypatch).startswith(("containment", "false alarm", "restart"))


@pytest.mark.parametrize("way", ["own moments", "erring clocks", "rates", "schedule"])
def test_late_data_that_are_not_brought_in_are_found(demo: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    monkeypatch.setattr(Estimator, "_rewind", lambda self, k: None)
    assert found_in(demo, way, monkeypatch).startswith("late data")


def test_about_half_of_the_seeds_go_by_time_and_every_way_is_drawn(demo: Path) -> None:
    base = configured(demo, 20, 0, Variant())
    drawn = [draw_times(random.Random(f"{seed}/times"), base) for seed in range(400)]
    assert 150 < drawn.count("") < 250
    assert set(drawn) == {"", *TIMES}
    assert all(str(draw_variant(random.Random(1), base)._replace(times=way)).endswith(way) for way in TIMES)


def test_meshes_that_go_by_equal_steps_stay_on_the_grid(demo: Path, tmp_path: Path) -> None:
    text = (
        demo.read_text()
        .replace('kind = "LSUP"', 'kind = "WindowMAP"')
        .replace('["box", "para", "cz"]', '["box", "cz"]')
    )
    (tmp_path / "mesh.toml").write_text(text)
    base = configured(tmp_path / "mesh.toml", 20, 0, Variant())
    assert {draw_times(random.Random(seed), base) for seed in range(50)} == {""}
