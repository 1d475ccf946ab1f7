"""Medians over the starts, of each role its largest process."""

from __future__ import annotations

from lsu_mesh.experiments.mesh_speed.bench_kinds import KINDS
from lsu_mesh.experiments.mesh_speed.start_report import Start, start_lines

STARTS = [
    Start(1.0, 2.0, 3.0, {"filter a": 10.0, "filter b": 30.0, "plant plant": 5.0}),
    Start(5.0, 6.0, 7.0, {"filter a": 20.0, "filter b": 10.0, "plant plant": None}),
    Start(2.0, 3.0, None, {"filter a": 10.0, "filter b": 10.0, "plant plant": 7.0}),
]


def test_a_line_for_each_time_and_role() -> None:
    lines = {line["what"]: line for line in start_lines(STARTS)}
    assert lines == {
        "all peers linked": {"type": "start", "what": "all peers linked", "seconds": 2.0},
        "first fused set": {"type": "start", "what": "first fused set", "seconds": 3.0, "processor_s": 5.0},
        "filter": {"type": "start", "what": "filter", "rss_mib": 20.0},
        "plant": {"type": "start", "what": "plant", "rss_mib": 6.0},
    }
    assert {name for line in lines.values() for name in line} - {"type"} == {"what", *KINDS["start"].lower_is_better}


def test_a_system_that_tells_nothing() -> None:
    (role,) = [line for line in start_lines([Start(1.0, 2.0, None, {"filter a": None})]) if line["what"] == "filter"]
    assert role["rss_mib"] is None
