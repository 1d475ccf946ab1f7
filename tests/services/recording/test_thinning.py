"""Numbers are drawn ten times a second, of the same steps everywhere; sparse series and misses are never left out."""

from __future__ import annotations

from pathlib import Path

import pytest
from drawn import drawn
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.synthetic_mesh import SyntheticMesh, written
from lsu_mesh_services.recording.thinning import REMEMBERED, Thinning, stride

from lsu_mesh.mesh.config import load
from lsu_mesh.supports.orthotope import Orthotope


@pytest.mark.parametrize(
    ("dt", "overrides", "expected"),
    [(0.02, [], 5), (0.1, [], 1), (1.0, [], 1), (0.02, ["mesh.rate=200"], 20), (0.02, ["recorder.draw_hz=50"], 1)],
)
def test_the_stride_follows_the_steps_of_a_second(
    tmp_path: Path, dt: float, overrides: list[str], expected: int
) -> None:
    assert stride(load(written(tmp_path, dt=dt).path, overrides)) == expected


def test_the_first_step_of_a_stretch_and_its_revisions_are_drawn(tmp_path: Path) -> None:
    thinning = Thinning(written(tmp_path))
    assert [k for k in range(1, 21) if thinning.draws("a", k)] == [1, 6, 11, 16]
    assert thinning.draws("a", 6), "a revision"
    assert not thinning.draws("a", 7)
    assert [k for k in (3, 8, 9, 30) if thinning.draws("b", k)] == [3, 8, 30], "a sparse series"
    for k in range(1, 5 * REMEMBERED + 200):
        thinning.draws("c", k)
    assert len(thinning._drawn["c"]) == REMEMBERED


def test_series_show_the_same_steps_and_raw_payloads_all(tmp_path: Path) -> None:
    configuration = written(tmp_path)
    recorder = Recorder(configuration, tmp_path / "x.rrd")
    arrivals = SyntheticMesh(configuration).run(40)
    for arrival in arrivals:
        recorder.record(*arrival)
        recorder.tick(arrival.arrival_ns)
    recorder.close()
    assert recorder.problems == []
    steps = [1, 6, 11, 16, 21, 26, 31, 36]
    for entity in ("/bands/alpha/f1", "/errors/beta/f3", "/truth/gamma", "/outputs/s1/s1/f2"):
        column = "Measurements:values"
        assert [step for step, _ in drawn(recorder.path, entity, column)] == steps, entity
    for entity in ("/widths/main", "/latency/f1", "/measured/s1/s1"):
        assert [step for step, _ in drawn(recorder.path, entity, "Scalars:scalars")] == steps, entity
    assert [raw.payload for raw in read_raw(recorder.path)] == [arrival.payload for arrival in arrivals]


@pytest.mark.parametrize("is_truth_first", [True, False])
def test_a_set_that_misses_the_truth_is_drawn_at_any_step(tmp_path: Path, is_truth_first: bool) -> None:
    configuration = written(tmp_path)
    recorder = Recorder(configuration, tmp_path / "x.rrd")
    mesh = SyntheticMesh(configuration)
    for k in range(1, 11):
        truth = next(arrival for arrival in mesh.step(k) if arrival.message.topic == "truth")
        far = 100.0 if k == 8 else 0.0
        box = Orthotope([far - 9, -9, -9], [far + 9, 9, 9])
        pair = [truth, mesh.arrival(mesh.posterior("filter/f1", k, box), k, 5)]
        for arrival in pair if is_truth_first else reversed(pair):
            recorder.record(*arrival)
    recorder.close()
    for entity in ("/bands/alpha/f1", "/errors/alpha/f1"):
        assert [step for step, _ in drawn(recorder.path, entity, "Measurements:values")] == [1, 6, 8]
