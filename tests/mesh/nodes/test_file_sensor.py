"""A file is played row by row, each at its own time."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.data_files import DataFileError
from lsu_mesh.mesh.messages import Input, Measurement, Truth
from lsu_mesh.mesh.nodes.file_sensor import FileSensorNode
from lsu_mesh.mesh.nodes.plant import PlantNode
from lsu_mesh.mesh.nodes.schedule import Schedule
from lsu_mesh.model import LSUModel

MESH = """
[mesh]
name = "filed"
dt = 0.5
start_time = 100.0
rate = 2.0
[model]
A = [[1.0, 0.5], [0.0, 1.0]]
B = [[0.0], [0.5]]
rho = [0.1, 0.1]
[model.prior]
lower = [-10.0, -10.0]
upper = [10.0, 10.0]
[plant]
file = "inputs.csv"
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
FLOW = LSUModel.continuous(
    [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.zeros((0, 2)), [0.1], [], noise_map=[[0.0], [1.0]]
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mesh.toml").write_text(MESH)
    (tmp_path / "inputs.csv").write_text("step,u\n1,0.5\n2,\n4,1.5\n")
    (tmp_path / "gauge.csv").write_text("t,height\n100.5,1\n")
    return tmp_path


def configured(folder: Path, rows: str, *, continuous: bool = True, **sensor: object) -> Configuration:
    """The mesh with these rows; of a continuous model unless told otherwise."""
    (folder / "gauge.csv").write_text("t,height\n" + rows)
    base = load(folder / "mesh.toml", ())
    gauge = dataclasses.replace(base.sensors["gauge"], **sensor)  # type: ignore[arg-type]
    return dataclasses.replace(base, sensors={"gauge": gauge}, continuous=FLOW if continuous else None)


def played(configuration: Configuration, until_s: float = 30.0) -> list[Measurement]:
    """All that the sensor sends."""
    node, found = FileSensorNode(configuration, "gauge", "0" * 16, Schedule(0, configuration.mesh.rate)), []
    for now in range(0, round(until_s * 1e9), 250_000_000):
        found += [m for m in node.tick(now) if isinstance(m, Measurement)]
    assert node.finished
    return found


def told(messages: Sequence[Measurement]) -> list[tuple[int, int, int | None, float | None]]:
    return [(m.step, m.time_ns, m.time_error_ns, m.y[0]) for m in messages]


def test_every_row_is_played_at_its_own_time_and_a_step_ends_with_its_own_moment(folder: Path) -> None:
    found = played(configured(folder, "100.5,1\n100.6,2\n100.7,3\n101.500000001,4\n102.0,5\n"))
    assert told(found) == [
        (1, 100_500_000_000, 0, 1.0),
        (2, 100_600_000_000, 0, 2.0),
        (2, 100_700_000_000, 0, 3.0),
        (2, 101_000_000_000, 0, None),
        (3, 101_500_000_000, 0, None),
        (4, 101_500_000_001, 0, 4.0),
        (4, 102_000_000_000, 0, 5.0),
    ], "the mark at the end of a step says that no more comes"


def test_two_rows_of_one_moment_are_two_measurements(folder: Path) -> None:
    found = played(configured(folder, "100.5,1\n100.5,1.25\n100.5,1.25\n"))
    assert [m.y[0] for m in found] == [1.0, 1.25, 1.25]
    assert {m.time_ns for m in found} == {100_500_000_000}


def test_the_rows_of_a_step_are_played_when_the_step_is_due(folder: Path) -> None:
    configuration = configured(folder, "100.6,2\n101.0,3\n101.2,4\n")
    node = FileSensorNode(configuration, "gauge", "0" * 16, Schedule(0, 2.0))
    assert [m for m in node.tick(499_999_999) if isinstance(m, Measurement)] == []
    assert [m.y[0] for m in node.tick(500_000_000) if isinstance(m, Measurement)] == [2.0, 3.0]
    assert node.wakeup() == 1_000_000_000


def test_rows_before_the_first_step_are_counted_and_told_once(folder: Path) -> None:
    configuration = configured(folder, "99,1\n99.7,1\n100,1\n100.2,2\n100.5,3\n")
    node = FileSensorNode(configuration, "gauge", "0" * 16, Schedule(0, 2.0))
    first, later = node.tick(0), node.tick(10_000_000_000)
    assert [(m.step, m.y[0]) for m in first if isinstance(m, Measurement)] == [(1, 2.0), (1, 3.0)]
    (event,) = [m for m in [*first, *later] if m.topic == "event"]
    assert event.code == "rows-before-the-prior"  # type: ignore[union-attr]
    assert event.about["rows"] == 3  # type: ignore[union-attr]
    assert node.counters() == {"before the prior": 3.0}


def test_rows_after_the_last_step_are_counted(folder: Path) -> None:
    base = configured(folder, "100.5,1\n101.1,2\n101.5,3\n101.6,4\n")
    short = dataclasses.replace(base, mesh=dataclasses.replace(base.mesh, steps=3))
    node = FileSensorNode(short, "gauge", "0" * 16, Schedule(0, 2.0))
    node.tick(10**10)
    assert node.counters() == {"after the last step": 1.0}
    assert node.step() == 3


def test_the_error_of_the_sensor_is_told_on_and_off_the_grid(folder: Path) -> None:
    found = played(configured(folder, "100.5,1\n100.75,2\n101.0,3\n", time_error_ns=5_000_000))
    assert [m.time_error_ns for m in found] == [5_000_000] * 3


def test_a_grid_of_thirds_is_met_by_integer_nanoseconds_alone(folder: Path) -> None:
    base = configured(folder, "100.033,1\n100.066666667,2\n100.1,3\n")
    grid = dataclasses.replace(base, mesh=dataclasses.replace(base.mesh, exact_dt=Fraction(1, 30)))
    found = [(m.step, m.time_ns) for m in played(grid) if m.y[0] is not None]
    assert found == [(1, 100_033_000_000), (2, 100_066_666_667), (3, 100_100_000_000)]


def test_a_discrete_model_takes_what_the_last_digit_leaves_open_as_on_the_grid(folder: Path) -> None:
    base = configured(folder, "100.033,1\n100.067,2\n100.1,3\n", continuous=False)
    thirds = dataclasses.replace(base, mesh=dataclasses.replace(base.mesh, exact_dt=Fraction(1, 30)))
    times = [thirds.grid.time_of(k) for k in (1, 2, 3)]
    assert [(m.step, m.time_ns) for m in played(thirds)] == list(zip((1, 2, 3), times, strict=True))
    strict = dataclasses.replace(
        thirds, sensors={"gauge": dataclasses.replace(thirds.sensors["gauge"], tolerance_ns=1000)}
    )
    off = [m.time_ns for m in played(strict) if m.y[0] is not None]
    assert off == [100_033_000_000, 100_067_000_000, 100_100_000_000]


def test_floating_point_times_are_known_to_half_their_spacing(folder: Path) -> None:
    start = 1_700_000_000.0
    times = np.array([start + 0.1, start + 0.2, start + 0.25, start + 0.3])
    np.savez(folder / "gauge.npz", t=times, height=np.arange(4.0))
    base = configured(folder, "100.5,1\n", time_error_ns=1_000)
    file = base.sensors["gauge"].file
    assert file is not None
    file = dataclasses.replace(file, path=folder / "gauge.npz")
    configuration = dataclasses.replace(
        base,
        sensors={"gauge": dataclasses.replace(base.sensors["gauge"], file=file)},
        mesh=dataclasses.replace(base.mesh, exact_dt=Fraction(1, 10), start_time=start, start_ns=int(start) * 10**9),
    )
    found = [(m.step, m.time_ns - int(start) * 10**9, m.time_error_ns) for m in played(configuration)]
    half = round(np.spacing(start) / 2 * 1e9)
    assert found[0] == (1, 100_000_000, 1_000), "the interval of the time holds t_k"
    assert found[1] == (2, 200_000_000, 1_000)
    step, since, error = found[2]
    assert (step, since) == (3, 250_000_000), "this one is a float itself"
    assert error is not None
    assert 1_000 + half <= error <= 1_000 + half + 1


def test_a_file_by_step_says_the_moment_of_the_step(folder: Path) -> None:
    base = configured(folder, "100.5,1\n")
    (folder / "gauge.csv").write_text("step,height\n1,1\n2,\n4,3\n4,5\n")
    file = base.sensors["gauge"].file
    assert file is not None
    gauge = dataclasses.replace(
        base.sensors["gauge"], file=dataclasses.replace(file, index="step", indexed_by="step"), time_error_ns=7
    )
    found = played(dataclasses.replace(base, sensors={"gauge": gauge}))
    t = base.grid.time_of
    assert told(found) == [
        (1, t(1), 7, 1.0),
        (2, t(2), 7, None),
        (3, t(3), 0, None),
        (4, t(4), 7, 3.0),
        (4, t(4), 7, 5.0),
    ]


def test_times_before_1970_go_by_their_step_or_are_refused_by_name(folder: Path) -> None:
    base = configured(folder, "-1,1\n-0.5,2\n0,3\n")
    mesh = dataclasses.replace(base.mesh, start_time=-1.5, start_ns=-1_500_000_000)
    assert told(played(dataclasses.replace(base, mesh=mesh))) == [(1, 0, None, 1.0), (2, 0, None, 2.0), (3, 0, 0, 3.0)]
    off = dataclasses.replace(configured(folder, "-1,1\n-0.6,2\n0,3\n"), mesh=mesh)
    with pytest.raises(ModelError, match=r"-0\.6 s ± 0 ns is before 1970 and off the grid.*add a constant"):
        played(off)


def inputs_of(configuration: Configuration) -> tuple[dict[int, float], list[str], int]:
    """Inputs by step, codes of events, and how many truths the plant tells."""
    plant = PlantNode(configuration, "plant", "0" * 16, Schedule(0, 2.0))
    said = [m for now in range(0, 10**10, 10**9) for m in plant.tick(now)]
    assert plant.finished
    return (
        {m.step: m.u[0] for m in said if isinstance(m, Input)},
        [m.code for m in said if m.topic == "event"],  # type: ignore[union-attr]
        sum(isinstance(m, Truth) for m in said),
    )


def test_real_measurements_have_no_truth_and_unknown_inputs_are_not_made_up(folder: Path) -> None:
    inputs, events, truths = inputs_of(configured(folder, "100.5,1\n"))
    assert inputs == {1: 0.5, 4: 1.5}
    assert events == ["input-missing"]
    assert truths == 0


def test_where_a_sensor_is_simulated_the_plant_is_driven_by_what_it_says(folder: Path) -> None:
    inputs, events, truths = inputs_of(configured(folder, "100.5,1\n", file=None))
    assert inputs == {1: 0.5, 2: 0.0, 3: 0.0, 4: 1.5}
    assert events == []
    assert truths == 4


@pytest.mark.parametrize("continuous", [True, False])
def test_inputs_by_time_begin_a_step(folder: Path, continuous: bool) -> None:
    base = configured(folder, "100.5,1\n", continuous=continuous)
    assert base.plant is not None
    assert base.plant.file is not None
    file = dataclasses.replace(base.plant.file, index="t", indexed_by="time")
    configuration = dataclasses.replace(base, plant=dataclasses.replace(base.plant, file=file))
    (folder / "inputs.csv").write_text("t,u\n99,7\n100.5,1\n101,2\n102,3\n")
    assert inputs_of(configuration)[0] == {1: 1.0, 2: 2.0, 4: 3.0}
    (folder / "inputs.csv").write_text("t,u\n100.5,1\n101.003,2\n101.499,3\n")
    with pytest.raises(DataFileError, match=r"line 3: the input begins 3 ms after a step \(2 such rows\).*input_delay"):
        inputs_of(configuration)
    (folder / "inputs.csv").write_text("t,u\n100.5,1\n101.003,2\n")
    assert inputs_of(dataclasses.replace(configuration, input_delay_ns=3_000_000))[0] == {1: 1.0, 2: 2.0}
    (folder / "inputs.csv").write_text("t,u\n100.5,1\n101,2\n101.0,3\n")
    with pytest.raises(DataFileError, match="line 4: step 2 has an input already"):
        inputs_of(configuration)
