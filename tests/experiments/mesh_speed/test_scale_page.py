"""The page tells what was measured, on what, and what is projected."""

from __future__ import annotations

from pathlib import Path

from lsu_mesh.experiments.mesh_speed.scale import BANK, PROCESSES, Cost
from lsu_mesh.experiments.mesh_speed.scale_page import HEAD, NOTES, scale_page

MS, US = "processor ms a step of all", "µs a step of all"
COSTS = [Cost(PROCESSES, count, 2.0 + 0.5 * count, MS) for count in (6, 9, 13, 17)]
COSTS += [Cost(BANK, count, 0.5 * count, US) for count in (1, 10, 100)]


def page() -> str:
    return scale_page(COSTS, date="2026-11-30", commit="0123abcd", machine={"cores": 2, "numba": None})


def test_what_was_measured_stands_beside_what_is_projected() -> None:
    lines = page().splitlines()
    assert "Measured on 2026-11-30, commit 0123abcd: cores 2." in lines
    assert "| 100 | 50 | 100 | measured |" in lines
    assert "| 400 | 200 | 400 | projected |" in lines
    assert "A line: 2 and 0.5 for each process; exponent 0.79." in lines


def test_cores_follow_from_the_line() -> None:
    """24 filters are 29 processes: 16.5 ms a step."""
    assert "| 24 | 0.825 | 3.3 | projected |" in page().splitlines()
    assert "| 12 | 0.525 | 2.1 | between measured sizes |" in page().splitlines()


def test_a_mesh_that_lost_steps_does_not_bend_the_line() -> None:
    costs = [*COSTS[:4], Cost(PROCESSES, 25, 3.0, MS, kept_up=False)]
    lines = scale_page(costs, date="2026-11-30", commit=None, machine={}).splitlines()
    assert "| 25 | 3 | 0.6 | measured; it lost steps, which cost nothing |" in lines
    assert "| 24 | 0.825 | 3.3 | projected |" in lines


def test_nothing_is_projected_from_meshes_that_lost_steps() -> None:
    costs = [COSTS[0], *(Cost(PROCESSES, count, 3.0, MS, kept_up=False) for count in (9, 13))]
    text = scale_page(costs, date="2026-11-30", commit=None, machine={})
    assert "nothing is projected" in text
    assert "projected |" not in text


def test_the_page_in_the_docs_is_of_this_form(root: Path) -> None:
    text = (root / "docs" / "scaling.md").read_text(encoding="utf-8")
    assert text.startswith(HEAD)
    assert text.endswith(NOTES)
