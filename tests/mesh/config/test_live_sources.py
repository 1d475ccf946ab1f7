"""Sources that are programs of their own: what the configuration makes of them, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from lsu_mesh.mesh.config import ConfigurationError, load
from lsu_mesh.mesh.config.load import load_values
from lsu_mesh.mesh.config.settings import Configuration

MESH = """
[mesh]
name = "own"
dt = 0.1
[model]
continuous = true
A = [[0.0, 1.0], [0.0, 0.0]]
B = [[0.0], [1.0]]
noise_map = [[0.0], [1.0]]
rho = [2.0]
[model.prior]
lower = [-1.0, -1.0]
upper = [1.0, 1.0]
[model.input_box]
lower = [-1.0]
upper = [1.0]
[sensors.gauge]
source = "external"
C = [[1.0, 0.0]]
r = [0.5]
[filters.main]
kind = "LSUPB"
sensors = ["gauge"]
"""
START_NS = 1_764_468_000_123_456_789


def read(folder: Path, text: str = MESH, *overrides: str) -> Configuration:
    (folder / "mesh.toml").write_text(text)
    return load(folder / "mesh.toml", overrides)


def mistakes(folder: Path, text: str, *overrides: str) -> list[str]:
    with pytest.raises(ConfigurationError) as error:
        read(folder, text, *overrides)
    return [problem.sentence for problem in error.value.records]


def test_a_mesh_with_an_external_sensor_needs_no_plant_and_starts_now(tmp_path: Path) -> None:
    mesh = read(tmp_path)
    assert mesh.plant is None
    assert mesh.sensors["gauge"].source == "external"
    assert mesh.is_external("sensor", "gauge")
    assert not mesh.is_external("filter", "main")
    assert mesh.awaits_start
    assert mesh.mesh.is_live
    assert (mesh.mesh.future_ns, mesh.mesh.past_ns) == (2 * 10**9, 8 * 10**9)
    assert [str(warning) for warning in mesh.warnings] == []


def test_its_start_is_kept_to_the_nanosecond_and_read_again_from_its_values(tmp_path: Path) -> None:
    mesh = read(tmp_path).started(START_NS)
    assert not mesh.awaits_start
    assert mesh.grid.start_ns == START_NS
    again = load_values(mesh.values, mesh.path)
    assert again.grid.start_ns == START_NS
    assert again.mesh.is_live
    assert again.digest() == mesh.digest()


def test_meshes_that_started_at_other_times_refuse_one_another(tmp_path: Path) -> None:
    mesh = read(tmp_path, MESH.replace("continuous = true", "").replace("r = [0.5]", "r = [0.5]\nrate = [9.0]"))
    assert mesh.started(START_NS).digest() != mesh.started(START_NS + 1).digest()


def test_a_start_that_is_given_stays(tmp_path: Path) -> None:
    mesh = read(tmp_path, MESH, "mesh.start_time=100.5")
    assert not mesh.awaits_start
    assert mesh.mesh.is_live
    assert mesh.grid.start_ns == 100_500_000_000


def test_any_mesh_may_start_now(demo: Path) -> None:
    assert load(demo, ('mesh.start_time="now"',)).awaits_start
    assert not load(demo).mesh.is_live


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("dt = 0.1", "dt = 0.1\nrate = 5.0"), "rate: has no place here: [sensors.gauge] is live"),
        (("r = [0.5]", 'r = [0.5]\nfaults = [{kind = "bias"}]'), "faults are simulated, and this sensor is not"),
        (("r = [0.5]", "r = [0.5]\nsimulated_r = [0.5]"), 'source = "simulated"'),
        (("r = [0.5]", 'r = [0.5]\nevery = "10ms"'), "is simulated, and this sensor is not"),
        (("r = [0.5]", 'r = [0.5]\nfile = "x.csv"'), 'is "external", but a file is given'),
        (('"external"', '"externl"'), "did you mean"),
        (("[sensors.gauge]", '[plant]\nsource = "external"\nx1 = [0.0, 0.0]\n[sensors.gauge]'), "x1: has no effect"),
        (
            (
                "[filters.main]",
                '[plant]\nsource = "external"\n[sensors.s]\nC = [[1.0, 0.0]]\nr = [1.0]\n[filters.main]',
            ),
            "the plant is external and tells no state",
        ),
        (
            ("rho = [2.0]", 'rho = [2.0]\nschedule = [{from = "2024-05-01T12:00:00Z", rho = [3.0]}]'),
            'is a moment, but [mesh] start_time is "now"',
        ),
        (
            ("[filters.main]", '[sensors.s]\nC = [[1.0, 0.0]]\nr = [1.0]\nfile = "s.csv"\ntime = "t"\n[filters.main]'),
            'orders rows by time, but [mesh] start_time is "now"',
        ),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    (tmp_path / "s.csv").write_text("t,y\n1.0,2.0\n")
    assert change[0] in MESH
    assert any(words in sentence for sentence in mistakes(tmp_path, MESH.replace(*change, 1)))


def test_an_external_plant_needs_inputs(tmp_path: Path) -> None:
    plant = MESH.replace("[sensors.gauge]", '[plant]\nsource = "external"\n[sensors.gauge]')
    mesh = read(tmp_path, plant)
    assert mesh.is_external("plant", "plant")
    box = "[model.input_box]\nlower = [-1.0]\nupper = [1.0]\n"
    without = plant.replace("B = [[0.0], [1.0]]\n", "").replace(box, "")
    assert any("the model has no inputs that a program could send" in one for one in mistakes(tmp_path, without))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("continuous = true", ""), "a discrete model takes only those on the grid"),
        (("[model.input_box]\nlower = [-1.0]\nupper = [1.0]\n", ""), "give input_box"),
        (("[filters.main]", "[sensors.s]\nC = [[1.0, 0.0]]\nr = [1.0]\n[filters.main]"), "beside gauge, which is live"),
    ],
)
def test_what_will_not_work_is_warned_of(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    assert any(words in str(warning) for warning in read(tmp_path, MESH.replace(*change, 1)).warnings)


def test_inputs_of_a_program_begin_anywhere_in_their_step(tmp_path: Path) -> None:
    plant = MESH.replace("[sensors.gauge]", '[plant]\nsource = "external"\n[sensors.gauge]')
    assert read(tmp_path, plant).input_delay_ns == 10**8 - 1
    assert read(tmp_path, plant, 'model.input_delay="5ms"').input_delay_ns == 5_000_000
    discrete = plant.replace("continuous = true", "").replace("r = [0.5]", "r = [0.5]\nrate = [9.0]")
    assert read(tmp_path, discrete).input_delay_ns == 10**8 - 1
    box = "[model.input_box]\nlower = [-1.0]\nupper = [1.0]\n"
    assert any("what acts before its first input" in one for one in mistakes(tmp_path, plant.replace(box, "")))
    seen = discrete.replace("rate = [9.0]", "rate = [9.0]\nD = [[1.0]]")
    assert any("what an output with D sees then is not known" in one for one in mistakes(tmp_path, seen))
