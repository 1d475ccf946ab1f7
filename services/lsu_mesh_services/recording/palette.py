"""One colour per peer, the same in every view. Saturated colours only: the viewer may be light or dark."""

from __future__ import annotations

from collections.abc import Mapping

from lsu_mesh.mesh.config import Configuration

Color = tuple[int, int, int]

TRUTH: Color = (235, 20, 130)
FUSIONS: tuple[Color, ...] = ((255, 130, 0), (205, 95, 0), (235, 150, 40))
FILTERS: tuple[Color, ...] = (
    (30, 120, 255),
    (0, 170, 75),
    (150, 75, 255),
    (0, 170, 195),
    (165, 100, 40),
    (140, 150, 0),
    (225, 70, 70),
    (90, 90, 220),
    (0, 130, 110),
    (200, 80, 200),
    (110, 160, 60),
    (120, 110, 140),
)
IDENTIFIER: Color = (235, 60, 60)
OTHER: Color = (125, 135, 145)
ABSENT: Color = (150, 150, 150)

STATUS: Mapping[str, Color] = {
    "ok": (0, 160, 80),
    "predicted": (30, 120, 255),
    "inconsistent": (230, 40, 40),
    "restarted": (255, 130, 0),
    "gone": ABSENT,
}
HEALTH: Mapping[str, Color] = {
    "OK": (0, 160, 80),
    "WARN": (255, 130, 0),
    "ERROR": (230, 40, 40),
    "STALE": (150, 75, 255),
    "gone": ABSENT,
}
TRUST: Mapping[str, Color] = {
    "accepted": (0, 160, 80),
    "rejected": (230, 40, 40),
    "quarantined": (150, 75, 255),
    "silent": ABSENT,
}


def colors(configuration: Configuration) -> dict[str, Color]:
    """Colour of every filter and fusion peer by name."""
    chosen = {name: FILTERS[i % len(FILTERS)] for i, name in enumerate(configuration.filters)}
    chosen |= {name: FUSIONS[i % len(FUSIONS)] for i, name in enumerate(configuration.fusion)}
    return chosen
