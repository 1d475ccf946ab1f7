"""The table of a run: what the numbers mean."""

from __future__ import annotations

import random
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lsu_mesh_services.monitoring.run_report import Row, RunReport, Sample

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.messages import Bounds, Message, OrthotopeMessage, Posterior, Truth, encode


class Story:
    """Messages of one filter and the plant, told to a report."""

    def __init__(self, demo: Path) -> None:
        self.configuration = load(demo)
        self.report = RunReport(self.configuration)
        self._sequences: dict[str, int] = {}

    def tell(self, made: type[Message], key: str, src: str, step: int, arrival_ns: int = 0, **fields: Any) -> None:
        seq = self._sequences[key] = self._sequences.get(key, -1) + 1
        common = {
            "v": 1, "src": src, "boot": "0" * 16, "seq": seq, "step": step, "sent_ns": 0, "origin_ns": 0,
            "model": self.configuration.digest(),
        }  # fmt: skip
        self.report.deliver(f"lsu/v1/demo/{key}", encode(made(**common, **fields)), arrival_ns)

    def truth(self, step: int, x: list[float]) -> None:
        self.tell(Truth, "truth/plant", "plant/plant", step, x=x)

    def posterior(self, step: int, low: float, high: float, arrival_ns: int = 0, **changes: Any) -> None:
        fields: dict[str, Any] = {
            "kind": "LSUO", "support": OrthotopeMessage(lower=[low] * 3, upper=[high] * 3), "lower": [low] * 3,
            "upper": [high] * 3, "point": [0.5 * (low + high)] * 3, "log_volume": None, "volume_of": "support",
            "status": "ok", "revision": 0, "epoch": 0, "guarantee": "declared", "base": "prior",
            "used": [("measurement", "sensor/s1", "0" * 16, step)], "bounds": Bounds(rho=[], r=[]), "missing": [],
        }  # fmt: skip
        self.tell(Posterior, "posterior/box", "filter/box", step, arrival_ns, **(fields | changes))

    def row(self) -> Row:
        return next(row for row in self.report.rows() if row.name == "box")


@pytest.fixture
def story(demo: Path) -> Story:
    return Story(demo)


def test_errors_widths_and_latencies_are_those_of_the_definitions(story: Story) -> None:
    story.truth(1, [0.0, 0.0, 0.0])
    story.truth(2, [0.0, 0.0, 0.0])
    story.posterior(1, -1.0, 2.0, arrival_ns=2_000_000)
    story.posterior(2, -1.0, 2.0, arrival_ns=4_000_000)
    row = story.row()
    assert row.rmse == pytest.approx(0.5)
    assert row.width == pytest.approx(3.0)
    assert row.inside == 1.0
    assert row.latency_p50_ms == pytest.approx(3.0)


@pytest.mark.parametrize("truth_first", [True, False])
def test_a_truth_outside_is_counted_whichever_comes_first(story: Story, truth_first: bool) -> None:
    if truth_first:
        story.truth(1, [3.0, 0.0, 0.0])
    story.posterior(1, -1.0, 2.0)
    if not truth_first:
        story.truth(1, [3.0, 0.0, 0.0])
    story.truth(2, [0.0, 0.0, 0.0])
    story.posterior(2, -1.0, 2.0)
    assert story.row().inside == 0.5


def test_a_step_counts_as_outside_even_if_a_later_revision_holds_the_truth(story: Story) -> None:
    story.truth(1, [3.0, 3.0, 3.0])
    story.posterior(1, -1.0, 2.0)
    story.posterior(1, -1.0, 4.0, revision=1)
    row = story.row()
    assert row.inside == 0.0
    assert row.steps == 1
    assert row.width == 5.0


def test_without_truth_there_is_no_error_and_no_share(story: Story) -> None:
    story.posterior(1, -1.0, 2.0)
    row = story.row()
    assert row.rmse is None
    assert row.inside is None
    assert row.width == 3.0


def test_a_long_run_is_summed_up_as_a_short_one_is_and_keeps_little(
    demo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def told(story: Story) -> Row:
        draw = random.Random(5)
        for k in range(1, 201):
            story.truth(k, [draw.uniform(-1, 1), 0.0, 0.0])
            status = "inconsistent" if k % 7 == 0 else "ok"
            low, high = sorted((draw.uniform(-1, 0.2), draw.uniform(0.1, 1)))
            story.posterior(k, low, high, arrival_ns=draw.randrange(10**9), status=status)
            if k % 5 == 0:
                story.posterior(k - 3, -2.0, 2.0, revision=1)
        return story.row()

    whole = Story(demo)
    expected = told(whole)
    assert expected.inside is not None
    assert 0.1 < expected.inside < 0.9
    monkeypatch.setattr("lsu_mesh_services.monitoring.run_report.KEPT_STEPS", 8)
    monkeypatch.setattr("lsu_mesh_services.monitoring.run_report.KEPT_TRUTHS", 16)
    short = Story(demo)
    row = told(short)
    for name, value in asdict(expected).items():
        assert getattr(row, name) == pytest.approx(value), name
    track = short.report.tracks["box"]
    assert len(track.told) == 8
    assert len(track.outside) + len(track.inconsistent) <= 16


def test_latencies_beyond_the_limit_are_a_fair_sample() -> None:
    sample = Sample(most=500)
    for number in range(20_000):
        sample.add(float(number))
    assert len(sample.numbers) == 500
    assert len(set(sample.numbers)) == 500
    assert np.mean(sample.numbers) == pytest.approx(10_000, rel=0.1)
