"""``lsu-mesh replay --smooth``: the recorded data through filters with a lag, beside the same filters' sets without."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from local_mesh import LocalMesh
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import OK, USAGE
from lsu_mesh_services.recording.read import read_recording
from lsu_mesh_services.replay.compare import CannotReplay
from lsu_mesh_services.replay.smooth import smoothed_rows, with_lag

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import Posterior, Smoothed
from lsu_mesh.mesh.simulator.time_variants import timed

Run = Callable[..., tuple[int, list[dict[str, Any]], str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """``lsu-mesh replay … --json``: exit code, JSON lines, stderr."""

    def call(*arguments: object) -> tuple[int, list[dict[str, Any]], str]:
        code = main(["replay", *map(str, arguments), "--json"])
        out, err = capsys.readouterr()
        return code, [json.loads(line) for line in out.splitlines()], err

    return call


def test_the_smoothed_sets_are_recorded_verified_and_summed_up(
    run: Run, mesh: LocalMesh, recording: Path, tmp_path: Path
) -> None:
    target = tmp_path / "smooth.rrd"
    code, lines, _ = run(recording, "--smooth", 3, "--record", target)
    assert code == OK
    (row,) = [line for line in lines if line["type"] == "smoothed"]
    assert (row["name"], row["lag"], row["steps"], row["inside"]) == ("cz-new", 3, 57, 1.0)
    messages = [one.message for one in read_recording(target).received]
    smoothed = {one.step: one for one in messages if isinstance(one, Smoothed)}
    filtered = {one.step: one for one in messages if isinstance(one, Posterior) and one.name == "cz-new"}
    widths = [[np.subtract(of[k].upper, of[k].lower) for k in smoothed] for of in (smoothed, filtered)]
    assert row["width"] == pytest.approx(np.mean(widths[0]), rel=1e-12)
    assert row["filtered_width"] == pytest.approx(np.mean(widths[1]), rel=1e-12)
    assert row["width"] < row["filtered_width"]
    truth = mesh.truth()
    for k, one in smoothed.items():
        assert all(low <= x <= high for low, x, high in zip(one.lower, truth[k], one.upper, strict=True))
    code, lines, _ = run(target, "--verify")
    assert code == OK
    assert {line["peer"]: line["exact"] for line in lines if line["type"] == "peer"}["filter/cz-new"] == 2 * 60 + 57


def test_people_see_a_table_and_five_steps_are_the_default(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(recording), "--smooth", "--record", str(tmp_path / "out.rrd")]) == OK
    lines = capsys.readouterr().out.splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("smoothed"))
    assert lines[at].split() == ["smoothed", "lag", "steps", "truth", "inside", "mean", "width", "filtered", "ratio"]
    assert lines[at + 1].split()[:5] == ["cz-new", "5", "55", "100", "%"]


def test_a_lag_longer_than_the_run_is_told(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(recording), "--smooth", "80", "--record", str(tmp_path / "out.rrd")]) == OK
    assert "no smoothed sets: no filter has gone on for 81 steps" in capsys.readouterr().out


def test_the_limits_of_the_sets_are_raised_with_the_lag(demo: Path, root: Path) -> None:
    """n = 3 generators and the filter's 2 outputs for each step; a limit that grows by itself is left alone."""
    plain = load(demo)
    found = with_lag(plain, 4)
    options = found.filters["cz"].options
    assert options == {"max_generators": 20 + 12, "max_constraints": 8 + 8, "lag": 4}
    assert with_lag(found, 2).filters["cz"].options == {"max_generators": 26, "max_constraints": 12, "lag": 2}
    assert {name: one for name, one in found.filters.items() if name != "cz"} == {
        name: one for name, one in plain.filters.items() if name != "cz"
    }
    assert with_lag(load(root / "examples" / "mesh.toml"), 2).filters["cz"].options == {"max_constraints": 12, "lag": 2}


def test_a_mesh_without_a_filter_that_smooths_is_told_the_remedy(run: Run, recording: Path) -> None:
    changes = ["filters.cz={kind='LSUPB', sensors=['s2', 's3']}"]
    code, _, err = run(recording, "--smooth", 2, "-X", changes[0])
    assert code == USAGE
    assert "no filter can smooth, its kinds are LSUO, LSUP, LSUPB" in err
    assert "--with other.toml" in err
    assert "kind LSUCZ" in err


def test_a_continuous_model_is_refused(demo: Path) -> None:
    with pytest.raises(CannotReplay, match="a lag counts time updates"):
        with_lag(timed(load(demo), "continuous"), 2)


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--smooth", "--verify"], "leave out --smooth"),
        (["--smooth", "2", "--live"], "leave one of them out"),
    ],
)
def test_flags_that_contradict_each_other(run: Run, recording: Path, flags: list[str], words: str) -> None:
    code, _, err = run(recording, *flags)
    assert code == USAGE
    assert words in err


@pytest.mark.parametrize("number", ["0", "-1", "2.5", "x"])
def test_a_lag_is_a_number_of_steps(recording: Path, number: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["replay", str(recording), f"--smooth={number}"])
    assert caught.value.code == USAGE
    assert "expected a number of steps, 1 or more" in capsys.readouterr().err


def test_a_set_of_any_revision_that_misses_the_truth_counts(mesh_with_lag: LocalMesh) -> None:
    messages = [message for _, message in mesh_with_lag.sent]
    one = next(message for message in messages if isinstance(message, Smoothed) and message.step == 5)
    truth = dict(mesh_with_lag.truth())
    (row,) = smoothed_rows(messages, truth)
    assert row.inside == 1.0
    truth[5] = [value + 1.0 for value in one.upper]
    (row,) = smoothed_rows(messages, truth)
    assert row.inside == pytest.approx(1.0 - 1.0 / row.steps)
    (row,) = smoothed_rows(messages, {})
    assert row.inside is None


@pytest.fixture(scope="module")
def mesh_with_lag(demo: Path) -> LocalMesh:
    configuration = load(demo, ["mesh.steps=20"])
    settings = configuration.filters["cz"]
    filters = {**configuration.filters, "cz": replace(settings, options={**settings.options, "lag": 2})}
    mesh = LocalMesh(replace(configuration, filters=filters))
    mesh.run(0.7)
    return mesh
