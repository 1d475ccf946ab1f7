"""What is drawn are the numbers of the messages."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from drawn import drawn, messages, values_of
from local_mesh import LocalMesh
from lsu_mesh_services.recording.blueprint import _bands
from lsu_mesh_services.recording.entity_paths import EntityPaths
from lsu_mesh_services.recording.entity_paths import path as entity_path
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.recording.synthetic_mesh import Arrival, SyntheticMesh, written
from recorded_mesh import record as recorded
from rerun.chunk import RrdReader

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.messages import Fused, Measurement, Posterior, Prediction, Smoothed, Truth

Record = Callable[[Configuration, Sequence[Arrival]], Path]


@pytest.fixture
def arrivals(configuration: Configuration) -> list[Arrival]:
    return SyntheticMesh(configuration).run(60)


def test_truth_bands_and_errors_are_the_numbers_of_the_messages(
    configuration: Configuration, arrivals: list[Arrival], record: Record
) -> None:
    path = record(configuration, arrivals)
    truth = np.array([m.x for m in messages(arrivals, Truth)])
    for name, kind in (("f1", Posterior), ("f2", Posterior), ("f3", Posterior), ("main", Fused)):
        said = messages(arrivals, kind, name)
        for i, state in enumerate(("alpha", "beta", "gamma")):
            assert (values_of(path, f"/truth/{state}")[:, 0] == truth[:, i]).all()
            lower, point, upper = (np.array([getattr(m, f)[i] for m in said]) for f in ("lower", "point", "upper"))
            band = values_of(path, f"/bands/{state}/{name}")
            assert (band[:, 1:] == np.stack([lower, point, upper], axis=1)).all()
            half = np.sqrt(values_of(path, f"/bands/{state}/{name}", "Measurements:variances")[:, 0])
            assert band[:, 0] - half == pytest.approx(lower)
            assert band[:, 0] + half == pytest.approx(upper)
            errors = values_of(path, f"/errors/{state}/{name}")
            assert (errors[:, 1:4] == band[:, 1:] - truth[:, [i]]).all()
            assert (errors[:, 1] <= 0).all()
            assert (errors[:, 3] >= 0).all()
        widths = values_of(path, f"/widths/{name}", "Scalars:scalars")
        assert (widths == np.array([np.subtract(m.upper, m.lower) for m in said])).all()
        volumes = drawn(path, f"/log_volume/{name}", "Scalars:scalars")
        assert volumes == [(m.step, [m.log_volume]) for m in said if m.log_volume is not None]


def test_smoothed_bands_are_drawn_at_the_step_of_their_state(demo: Path, tmp_path: Path) -> None:
    mesh = LocalMesh(load(demo, ["mesh.steps=30", "filters.cz.lag=4", "recorder.draw_hz=50"]))
    mesh.run(1.0)
    path = recorded(mesh, tmp_path / "smoothed.rrd")
    said = mesh.of(Smoothed, "cz")
    assert len(said) == 26
    for i, state in enumerate(mesh.configuration.base_model.states):
        rows = drawn(path, f"/smoothed/{state}/cz", "Measurements:values")
        assert [step for step, _ in rows] == [m.step for m in said]
        band = np.array([values for _, values in rows])
        assert (band[:, 1] == [m.lower[i] for m in said]).all()
        assert (band[:, 3] == [m.upper[i] for m in said]).all()
        assert not drawn(path, f"/smoothed/{state}/box", "Measurements:values")


def test_the_plots_of_a_filter_with_a_lag_show_its_smoothed_bands(demo: Path) -> None:
    names = EntityPaths(load(demo, ["filters.cz.lag=4"]))
    state = names.states[0]
    own, other = _bands(names, 0, "cz"), _bands(names, 0, "box")
    assert entity_path("smoothed", state, "cz") in own.contents
    assert str(own.name).endswith("dark those given 4 more steps")
    assert not any("smoothed" in entity for entity in other.contents)
    assert names.smoothers == ("cz",)


def test_errors_wait_for_a_truth_that_comes_late(configuration: Configuration, record: Record) -> None:
    mesh = SyntheticMesh(configuration)
    arrivals = mesh.run(30)
    late = [a for a in arrivals if not isinstance(a.message, Truth)] + [
        a for a in arrivals if isinstance(a.message, Truth)
    ]
    path = record(configuration, late)
    assert [step for step, _ in drawn(path, "/errors/alpha/f1", "Measurements:values")] == list(range(1, 31))


def test_outputs_and_their_predictions(configuration: Configuration, arrivals: list[Arrival], record: Record) -> None:
    path = record(configuration, arrivals)
    said = messages(arrivals, Prediction, "f2")
    for i, sensor in enumerate(("s1", "s2", "s3")):
        band = values_of(path, f"/outputs/{sensor}/{sensor}/f2")
        assert (band[:, 1] == [m.y_lower[i] for m in said]).all()
        assert (band[:, 3] == [m.y_upper[i] for m in said]).all()
        measured = drawn(path, f"/measured/{sensor}/{sensor}", "Scalars:scalars")
        expected = [(m.step, m.y) for m in messages(arrivals, Measurement, sensor) if m.y != [None]]
        assert measured == expected
        assert len(expected) == 59  # one is missing


def test_latency_is_the_age_of_the_oldest_measurement(
    configuration: Configuration, arrivals: list[Arrival], record: Record
) -> None:
    path = record(configuration, arrivals)
    said = [a for a in arrivals if type(a.message) is Posterior and a.message.name == "f1"]
    expected = [(a.arrival_ns - a.message.origin_ns) / 1e6 for a in said]
    assert values_of(path, "/latency/f1", "Scalars:scalars")[:, 0] == pytest.approx(expected)
    assert expected[0] == pytest.approx(3.0, abs=0.1)


def test_sets_are_thinned_to_common_steps_and_numbers_are_not(
    configuration: Configuration, arrivals: list[Arrival], record: Record
) -> None:
    path = record(configuration, arrivals)
    steps = {
        name: [step for step, _ in drawn(path, f"/space/sets/{name}", "Mesh3D:vertex_positions")]
        for name in ("f1", "f2", "f3", "main")
    }
    assert len(steps["f1"]) in range(11, 14)  # 1.2 s at 10 Hz
    assert steps["f1"] == steps["f2"] == steps["f3"] == steps["main"]
    assert [step for step, _ in drawn(path, "/space/truth", "Points3D:positions")] == steps["f1"]
    truth = {m.step: m.x for m in messages(arrivals, Truth)}
    for step, points in drawn(path, "/space/truth", "Points3D:positions"):
        assert points == [pytest.approx(truth[step], rel=1e-6)]
    boxes = {m.step: m for m in messages(arrivals, Posterior, "f1")}
    for step, corners in drawn(path, "/space/sets/f1", "Mesh3D:vertex_positions"):
        assert np.min(corners, axis=0) == pytest.approx(boxes[step].lower, rel=1e-5, abs=1e-6)
        assert np.max(corners, axis=0) == pytest.approx(boxes[step].upper, rel=1e-5, abs=1e-6)


def test_a_peer_that_fell_silent_shows_no_old_set(configuration: Configuration, record: Record) -> None:
    arrivals = [a for a in SyntheticMesh(configuration).run(200) if a.message.name != "f2" or a.message.step < 60]
    path = record(configuration, arrivals)
    shown = drawn(path, "/space/sets/f2", "Mesh3D:vertex_positions")
    assert [bool(corners) for step, corners in shown if step < 60] == [True] * (len(shown) - 1)
    assert shown[-1][0] >= 60
    assert shown[-1][1] == []
    assert max(step for step, _ in drawn(path, "/space/sets/f1", "Mesh3D:vertex_positions")) > 100


def test_every_entity_is_documented(configuration: Configuration, root: Path, record: Record) -> None:
    arrivals = SyntheticMesh(configuration).run(5)
    path = record(configuration, arrivals)
    listed = re.findall(r"`(/[a-z_/<>]+)`", (root / "docs" / "recording.md").read_text())
    patterns = [re.compile(re.sub("<[a-z]+>", "[^/]+", entry)) for entry in listed]
    entities = {chunk.entity_path for chunk in RrdReader(path).stream()}
    unknown = [e for e in entities if not e.startswith("/__properties") and not any(p.fullmatch(e) for p in patterns)]
    assert unknown == []
    unused = [p.pattern for p in patterns if not any(p.fullmatch(e) for e in entities)]
    rare = ("/raw/refused", "/half_widths/", "/factor/", "/smoothed/")
    assert [pattern for pattern in unused if not pattern.startswith(rare)] == []


@pytest.mark.parametrize(("states", "filters"), [(1, 1), (2, 12), (12, 2)])
def test_any_number_of_states_and_filters(states: int, filters: int, tmp_path: Path, record: Record) -> None:
    configuration = written(tmp_path, states, filters)
    arrivals = SyntheticMesh(configuration).run(12)
    path = record(configuration, arrivals)
    assert len(read_raw(path)) == len(arrivals)
    assert drawn(path, "/space/sets/f1", "Mesh3D:vertex_positions")


def test_odd_names_of_states_do_not_collide(tmp_path: Path, record: Record) -> None:
    configuration = written(tmp_path)
    text = configuration.path.read_text().replace('["alpha", "beta", "gamma"]', '["Höhe/Rate", "x y", "x y"]')
    configuration.path.write_text(text)

    odd = load(configuration.path)
    path = record(odd, SyntheticMesh(odd).run(5))
    entities = {chunk.entity_path for chunk in RrdReader(path).stream() if chunk.entity_path.startswith("/truth/")}
    assert len(entities) == 3
