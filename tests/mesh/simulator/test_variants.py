"""The simulator runs the kinds of the configuration, whichever they are."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from lsu_mesh.mesh.simulator.run import run_seed
from lsu_mesh.mesh.simulator.variants import IN_ITS_PLACE, Variant, configured, draw_variant

SEEDS = range(40)


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
