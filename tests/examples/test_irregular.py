"""The car whose reports come at any moment: its data are what the script makes, and every set holds it."""

from __future__ import annotations

import importlib.util
import itertools
import sys
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from local_mesh import LocalMesh

from lsu_mesh import LSUCZ, LSUModel, Orthotope, run_filter
from lsu_mesh.mesh.config import load


def loaded(file: Path) -> ModuleType:
    specification = importlib.util.spec_from_file_location(f"irregular_{file.stem}", file)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[specification.name] = module
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def folder(root: Path) -> Path:
    return root / "examples" / "irregular"


@pytest.fixture(scope="module")
def data(folder: Path) -> ModuleType:
    return loaded(folder / "make_data.py")


@pytest.fixture
def run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(str(folder))
    yield loaded(folder / "run.py")
    sys.modules.pop("make_data", None)


def test_the_file_is_what_the_script_makes(folder: Path, data: ModuleType) -> None:
    _, reports = data.drive()
    assert (folder / "reports.csv").read_text() == data.text(reports)
    gaps = np.diff([report.ms for report in reports])
    assert 150 <= gaps.min() <= gaps.max() <= 500


@pytest.mark.parametrize("seed", [14, 1, 2, 3])
def test_every_report_is_true_and_the_car_keeps_its_bound(data: ModuleType, seed: int) -> None:
    course, reports = data.drive(seed)
    errors = [Fraction(mm, 1000) - course.at(Fraction(ms, 1000))[0] for ms, mm in reports]
    assert max(map(abs, errors)) <= Fraction(1, 2)
    assert max(map(abs, errors)) > Fraction(2, 5)
    moments = [Fraction(k, 50) for k in range(1, 3000)]
    speeds = [course.at(moment)[1] for moment in moments]
    assert max(abs(b - a) for a, b in itertools.pairwise(speeds)) <= Fraction(3, 50)


def test_the_library_holds_the_car_at_every_report(data: ModuleType) -> None:
    course, reports = data.drive()
    flow = LSUModel.continuous([[0.0, 1.0], [0.0, 0.0]], None, [[1.0, 0.0]], [3.0], [0.5], noise_map=[[0.0], [1.0]])
    engine = LSUCZ(flow.discretised(10**8), Orthotope([0.0, 15.0], [5.0, 25.0]))
    times = [ms * 10**6 for ms, _ in reports]
    run = run_filter(engine, [[mm / 1000] for _, mm in reports], times=times)
    for k, (ms, _) in enumerate(reports):
        state = course.at(Fraction(ms, 1000))
        bounds = zip(run.lower[k], state, run.upper[k], strict=True)
        assert all(Fraction(float(low)) <= x <= Fraction(float(high)) for low, x, high in bounds)


def test_every_set_of_the_mesh_holds_the_car(folder: Path, data: ModuleType) -> None:
    configuration = load(folder / "irregular.toml", ("mesh.steps=150",))
    mesh, course = LocalMesh(configuration), data.drive()[0]
    mesh.run(3.2, tick_ms=20)
    for name in mesh.estimators():
        newest = mesh.newest(name)
        assert sorted(newest) == list(range(1, 151))
        assert {one.guarantee for one in newest.values()} == {"declared"}
        for k, one in newest.items():
            bounds = zip(one.lower, course.at(Fraction(k, 10)), one.upper, strict=True)
            assert all(Fraction(low) <= x <= Fraction(high) for low, x, high in bounds), (name, k)
    assert mesh.events("contradiction") == []
    assert mesh.truth() == {}


def test_the_nearest_step_misses_the_car(
    folder: Path, data: ModuleType, run: ModuleType, tmp_path: Path
) -> None:  # fmt: skip
    import tomllib

    from lsu_mesh.mesh.config.write import to_toml

    values = run.on_the_nearest_step(tomllib.loads((folder / "irregular.toml").read_text()))
    (tmp_path / "nearest.toml").write_text(to_toml(values))
    mesh, course = LocalMesh(load(tmp_path / "nearest.toml", ("mesh.steps=150",))), data.drive()[0]
    mesh.run(3.2, tick_ms=20)
    newest = mesh.newest("cz")
    assert {one.guarantee for one in newest.values()} == {"none"}
    missing = sum(
        any(x < low or x > high for low, x, high in zip(one.lower, course.at(Fraction(k, 10)), one.upper, strict=True))
        for k, one in newest.items()
    )
    assert missing > 30, "this is what the times are for"
