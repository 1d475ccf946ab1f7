"""Data between the steps of a discrete model, and before the prior: refused, widened, or worth nothing, by name."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from exact_course import scene
from timed_mesh import TimedMesh, body, play, report

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.estimation.step_data import BEFORE_PRIOR, DataOfSteps
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import encode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.time_requirements import check_times
from lsu_mesh.mesh.verification import verify

SECOND, MS = 10**9, 10**6
LINE = """
[mesh]
name = "line"
dt = 0.1
[model]
A = [[1.0]]
rho = [0.1]
prior = { lower = [-5.0], upper = [5.0] }
[sensors.a]
C = [[1.0]]
r = [0.5]
[filters.box]
kind = "LSUO"
sensors = ["a"]
[filters.window]
kind = "WindowMAP"
sensors = ["a"]
"""


def line(path: Path, **sensor: object) -> Configuration:
    path.write_text(LINE)
    read = load(path)
    return replace(read, sensors={"a": replace(read.sensors["a"], **sensor)})  # type: ignore[arg-type]


def take(configuration: Configuration, *times: int, error_ns: int = 0) -> FilterNode:
    """A filter after measurements of 0 at these times."""
    node = FilterNode(configuration, "box", "0" * 16)
    for i, t in enumerate(times):
        message = report(configuration, "a", i, time_ns=t, y=[0.0], error_ns=error_ns)
        node.deliver(key("line", "measurement", "a"), encode(message), t)
        node.tick(t + 10 * SECOND)
    return node


def test_a_datum_between_the_steps_is_refused_and_counted_by_name(tmp_path: Path) -> None:
    node = take(line(tmp_path / "line.toml"), SECOND // 10, SECOND // 10 + 30 * MS)
    assert node.admission.refused == {"off the grid": 1}
    assert "a at 130000000 ns" in node.admission.last_refusal


def test_a_rate_widens_by_the_distance_to_the_step(tmp_path: Path) -> None:
    configuration = line(tmp_path / "line.toml", rate=(2.0,))
    message = replace_step(configuration, time_ns=130 * MS, error_ns=10 * MS)
    data = DataOfSteps(configuration, ["a"], "LSUO").gather(2, [message], np.array([0.5]), origin=None, known={})
    assert data.r is not None
    exact = Fraction(1, 2) + 2 * Fraction(80, 1000)
    assert exact <= Fraction(float(data.r[0])) <= exact * (1 + Fraction(1, 10**12))
    node = take(configuration, SECOND // 10, 130 * MS)
    assert node.last_posterior is not None
    assert node.last_posterior.guarantee == "declared"


def replace_step(configuration: Configuration, time_ns: int, error_ns: int):  # type: ignore[no-untyped-def]
    return report(configuration, "a", 0, time_ns=time_ns, y=[0.0], error_ns=error_ns, step=2)


def test_the_nearest_step_costs_the_guarantee_of_every_set(tmp_path: Path) -> None:
    configuration = line(tmp_path / "line.toml", off_grid="nearest")
    mesh = TimedMesh(replace(configuration, filters={"box": configuration.filters["box"]}))
    sent = [(t, report(configuration, "a", i, time_ns=t, y=[0.0])) for i, t in enumerate((100 * MS, 230 * MS))]
    play(mesh, sent, until_ns=2 * SECOND, tick_ns=50 * MS)
    sets = mesh.posteriors("box")
    assert [one.step for one in sets] == [1, 2]
    assert {one.guarantee for one in sets} == {"none"}
    found = verify(mesh.configuration, [message for _, message in mesh.sent])
    assert (found.differences, found.false_claims) == ([], [])


def test_data_before_the_prior_are_counted_and_not_used(tmp_path: Path) -> None:
    made = scene(0, speed=20.0, acceleration=1.0, r=0.5, apart=(0.15, 0.5), rows=5)
    configuration = body(tmp_path / "car.toml", made, dt=0.1)
    mesh = TimedMesh(configuration)
    early = [(200 * MS, report(configuration, "a", i, time_ns=t, y=[1e6])) for i, t in enumerate((0, 99 * MS))]
    on_time = report(configuration, "a", 2, time_ns=150 * MS, y=[float(made.course.at(150 * MS)[0])])
    play(mesh, [*early, (210 * MS, on_time)], until_ns=SECOND, tick_ns=50 * MS)
    assert mesh.nodes["lsuo"].counters()[BEFORE_PRIOR] == 2
    used = {reference for one in mesh.posteriors("lsuo") for reference in one.used}
    assert used & {early[0][1].reference, early[1][1].reference} == set()
    assert on_time.reference in used
    assert mesh.events("contradiction") == []


def test_kinds_and_settings_that_go_by_equal_steps_refuse_a_continuous_model(tmp_path: Path) -> None:
    made = scene(0, speed=20.0, acceleration=1.0, r=0.5, apart=(0.15, 0.5), rows=2)
    configuration = body(tmp_path / "car.toml", made, dt=0.1)
    window = replace(configuration.filters["lsuo"], kind="WindowMAP")
    with pytest.raises(ModelError, match="filter lsuo: WindowMAP needs one discrete model"):
        check_times(replace(configuration, filters={"lsuo": window}), "filter", "lsuo")
    with pytest.raises(ModelError, match="shorter than dt"):
        check_times(replace(configuration, input_delay_ns=SECOND), "filter", "lsuo")
