"""The simulator runs the kinds of the configuration, whichever they are."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.simulator.faults import FAULTS
from lsu_mesh.mesh.simulator.run import run_seed
from lsu_mesh.mesh.simulator.time_variants import draw_times
from lsu_mesh.mesh.simulator.variants import (
    IN_ITS_PLACE,
    MAX_CONSTRAINTS,
    MAX_GENERATORS,
    Variant,
    configured,
    draw_lag,
    draw_variant,
)
from lsu_mesh.model import LSUModel

SEEDS = range(40)
STEPS = 60


def with_kind(demo: Path, folder: Path, kind: str, *options: str) -> Path:
    """The demo with another kind for ``para``, which is no source of the fusion then."""
    text = demo.read_text().replace('kind = "LSUP"', "\n".join([f'kind = "{kind}"', *options]))
    assert kind in text
    if kind in ("Kalman", "WindowMAP"):
        text = text.replace('["box", "para", "cz"]', '["box", "cz"]')
    file = folder / "mesh.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize("kind", ["ZonotopicKalman", "Kalman", "lsu_mesh.filters.zonotopic_kalman:ZonotopicKalman"])
def test_every_variant_keeps_the_kinds_and_their_options(demo: Path, tmp_path: Path, kind: str) -> None:
    options = ("order = 7",) if "Zonotopic" in kind else ("sigmas = 2.0",)
    file = with_kind(demo, tmp_path, kind, *options)
    base = configured(file, 20, 0, Variant())
    for seed in SEEDS:
        found = configured(file, 20, 0, draw_variant(random.Random(seed), base)).filters
        assert (found["para"].kind, found["para"].options) == (kind, base.filters["para"].options)
        assert found["box"].kind == "LSUO"
        assert found["cz"].kind in IN_ITS_PLACE


def test_what_takes_the_place_of_a_constrained_zonotope_is_told(demo: Path) -> None:
    base = configured(demo, 20, 0, Variant())
    for seed in SEEDS:
        variant = draw_variant(random.Random(seed), base)
        for name, settings in configured(demo, 20, 0, variant).filters.items():
            assert settings.kind == base.filters[name].kind or f"{name}={settings.kind}" in str(variant)


@pytest.mark.parametrize("kind", ["ZonotopicKalman", "Kalman"])
def test_a_mesh_with_such_a_filter_keeps_the_invariants(demo: Path, tmp_path: Path, kind: str) -> None:
    """A Kalman filter may miss the truth, and says so; what is guaranteed beside it has to hold it all the same."""
    outcome = run_seed(with_kind(demo, tmp_path, kind), 3, 60, ("drop", "delay", "kill"))
    assert f"para={kind}" in outcome.variant
    assert outcome.broken == ""
    assert outcome.sets > 100


def smoothing_seeds(demo: Path) -> list[int]:
    """Seeds whose constrained zonotope has a lag."""
    base = configured(demo, STEPS, 0, Variant())
    found = []
    for seed in range(1, 200):
        variant = draw_variant(random.Random(seed), base)
        times = draw_times(random.Random(f"{seed}/times"), base) if variant.kinds else "as it is"
        if ("cz", "LSUCZ") in variant.kinds and draw_lag(random.Random(f"{seed}/lag"), base, times):
            found.append(seed)
    return found


def test_a_filter_with_a_lag_keeps_the_invariants(demo: Path) -> None:
    for seed in smoothing_seeds(demo)[:2]:
        outcome = run_seed(demo, seed, STEPS, FAULTS)
        assert "lag=2" in outcome.variant
        assert outcome.broken == ""


def test_a_filter_of_a_continuous_model_gets_no_lag(demo: Path, tmp_path: Path) -> None:
    """A step of a continuous model may take several time updates, and a lag counts them."""
    base = load(demo)
    flow = LSUModel.continuous(np.zeros((3, 3)), None, np.eye(3), [1.0] * 3, [1.0] * 3)
    drawn = [draw_lag(random.Random(seed), base, "") for seed in range(50)]
    assert any(drawn)
    moved = replace(base, continuous=flow)
    assert not any(draw_lag(random.Random(seed), moved, "as it is") for seed in range(50))


def test_the_set_of_another_step_is_found(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bounds = LSUCZ.smoothed_bounds
    monkeypatch.setattr(LSUCZ, "smoothed_bounds", lambda self, steps: bounds(self, 0))
    outcomes = [run_seed(demo, seed, STEPS, ()) for seed in smoothing_seeds(demo)[:3]]
    assert any(one.broken.startswith("containment") for one in outcomes)


def test_a_lag_of_the_configuration_leaves_room_for_the_earlier_states(demo: Path, tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(demo.read_text().replace("max_generators = 20", "max_generators = 32\nlag = 3", 1))
    found = configured(file, STEPS, 0, Variant((("cz", "LSUCZ"),))).filters["cz"]
    assert found.options["max_generators"] == MAX_GENERATORS + 3 * 3
    assert (found.options["lag"], found.options["max_constraints"]) == (3, MAX_CONSTRAINTS)
