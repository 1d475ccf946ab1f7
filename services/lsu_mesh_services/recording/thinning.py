"""Which steps are drawn, where a mesh makes more of them a second than anybody sees. Raw payloads are never thinned."""

from __future__ import annotations

from collections import defaultdict

from lsu_mesh.mesh.config import Configuration

REMEMBERED = 1024
"""Stretches of a series of which it is known which step was drawn, so that a revision of it is drawn too."""


class Thinning:
    """Draws, of every ``stride`` steps of a series, the first that comes, and whatever comes of that step again.

    Series that have rows at every step are drawn at the same steps, and of a series with few rows none is lost before
    others are.
    """

    def __init__(self, configuration: Configuration) -> None:
        self.stride = stride(configuration)
        self._drawn: defaultdict[str, dict[int, int]] = defaultdict(dict)

    def draws(self, series: str, step: int) -> bool:
        """Whether the row of this step is drawn."""
        if self.stride == 1:
            return True
        drawn, stretch = self._drawn[series], (step - 1) // self.stride
        if stretch not in drawn:
            drawn[stretch] = step
            if len(drawn) > REMEMBERED:
                del drawn[next(iter(drawn))]
        return drawn[stretch] == step


def stride(configuration: Configuration) -> int:
    """Steps of which one is drawn: those of a second, by the clock, over ``recorder.draw_hz``; at least 1."""
    rate = configuration.mesh.rate or 1.0 / configuration.mesh.dt
    return max(1, round(rate / configuration.recorder.draw_hz))
