"""Colours that are seen on a dark and on a light ground, and that differ from one another."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from lsu_mesh_services.recording import palette
from lsu_mesh_services.recording.palette import Color
from lsu_mesh_services.recording.synthetic_mesh import written

EVERY = [palette.TRUTH, palette.OTHER, *palette.FUSIONS, *palette.FILTERS]


def luminance(color: Color) -> float:
    """Relative luminance (WCAG 2)."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (part / 255 for part in color)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: Color, other: Color) -> float:
    lighter, darker = sorted((luminance(one), luminance(other)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("color", EVERY, ids=str)
def test_colours_are_seen_on_dark_and_light_ground(color: Color) -> None:
    assert contrast(color, (13, 13, 13)) > 3.0
    assert contrast(color, (255, 255, 255)) > 2.0


def test_no_two_colours_are_alike() -> None:
    for one, other in itertools.combinations([palette.TRUTH, palette.FUSIONS[0], *palette.FILTERS], 2):
        assert sum((a - b) ** 2 for a, b in zip(one, other, strict=True)) ** 0.5 > 50, (one, other)


def test_twelve_filters_have_twelve_colours_and_the_fusion_its_own(tmp_path: Path) -> None:
    chosen = palette.colors(written(tmp_path, 2, 12))
    assert len(set(chosen.values())) == 13
    assert chosen["main"] == palette.FUSIONS[0]
