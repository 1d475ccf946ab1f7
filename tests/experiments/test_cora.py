"""Our filters on systems in the form of the published benchmarks."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lsu_mesh.errors import ModelError
from lsu_mesh.experiments import cora, workers
from lsu_mesh.experiments.outcome import Outcome
from lsu_mesh.experiments.tightness import read_benchmark
from lsu_mesh.filters.lsucz import LSUCZ

SYSTEM = {
    "A": [[0.9, 0.2], [-0.1, 0.8]],
    "B": [[1.0], [0.5]],
    "C": [[1.0, 0.0]],
    "R0": {"center": [0.0, 0.0], "generators": [[1.0, 0.0], [0.0, 1.0]]},
    "W": {"center": [0.0, 0.0], "generators": [[0.1], [0.05]]},
    "V": {"center": [0.0], "generators": [[0.2]]},
    "u": [[0.3, -0.1, 0.2, 0.0]],
    "y": [[0.1, 0.4, 0.3, 0.4]],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One made-up system with the hulls of an unreduced filter as the exact ones, and two published estimators."""
    data: dict[str, object] = {
        "source": "Made up.",
        "system": SYSTEM,
        "exact_hulls": {},
        "tightness": {"k": 3, "estimators": {}},
    }
    path = tmp_path_factory.mktemp("systems") / "made.json"
    path.write_text(json.dumps(data))
    made = read_benchmark(path)
    engine = LSUCZ(made.model, made.prior, reduce=False)
    hulls = {}
    for k in range(4):
        engine.update(made.Y[k])
        lower, upper = engine.bounds()
        hulls[str(k)] = {"lo": lower.tolist(), "hi": upper.tolist()}
        engine.predict(made.U[k])
    data["exact_hulls"] = hulls
    wide = {"lo": (lower - (upper - lower)).tolist(), "hi": (upper + (upper - lower)).tolist()}
    narrow = {"lo": (0.9 * lower + 0.1 * upper).tolist(), "hi": upper.tolist()}
    data["cora_hulls"] = {"full": {"Wide": wide, "Narrow": narrow}}
    path.write_text(json.dumps(data))
    return path.parent


@pytest.fixture(scope="module")
def outcome(folder: Path) -> Outcome:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workers, "cores", lambda: 1)
        return cora.run(quick=True, folder=folder)


def test_ratios_are_to_the_exact_hulls(outcome: Outcome) -> None:
    rows = {row[0]: row for row in outcome.tables[0].rows}
    assert rows["LSUCZ(20, 8)"][2:] == (*[pytest.approx(1.0, rel=1e-9)] * 3, "yes")
    assert rows["Wide"][1:4] == ("published", pytest.approx(3.0), pytest.approx(3.0))
    assert rows["Narrow"][-1] == "no"
    assert rows["LSUO"][2] >= rows["LSUPB"][2] >= 1.0 - 1e-9
    assert outcome.checks[0].is_met


def test_times_are_in_a_table_of_their_own(outcome: Outcome) -> None:
    assert [table.name for table in outcome.tables] == ["cora-made", "cora-times"]
    assert all(row[2] > 0 for row in outcome.tables[1].rows)


def test_the_figure_shows_every_estimator(outcome: Outcome) -> None:
    axes = outcome.figures["cora-made"]().axes[0]
    assert {label.get_text() for label in axes.get_yticklabels()} == {row[0] for row in outcome.tables[0].rows}


def test_a_folder_without_systems_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="there is no JSON file"):
        cora.read_folder(tmp_path)


def test_published_systems_where_they_are_at_hand() -> None:
    published = Path(__file__).parents[2].parent / "shared" / "benchmarks"
    if not published.is_dir():
        pytest.skip(f"{published} is not there")
    for made in cora.read_folder(published):
        own = cora.result(cora.Job(published / f"{made.name}.json", "LSUCZ(20, 8)"))
        ratio = cora.ratio(made, own)
        assert ratio.holds
        assert np.isfinite(ratio.over_time)
        assert 1.0 - 1e-9 <= ratio.mean < 1.5
