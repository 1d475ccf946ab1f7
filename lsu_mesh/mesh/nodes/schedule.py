"""When the steps of a paced source are due."""

from __future__ import annotations

from dataclasses import dataclass

from lsu_mesh.mesh.grid import Grid

MAX_AT_ONCE = 64
"""Steps that a source publishes in one tick at most, so that a source that is late does not flood the mesh."""


@dataclass
class Schedule:
    """Step k is due at ``start_ns + (k − 1) · 1e9 / rate``; without a start nothing is due yet."""

    start_ns: int | None
    rate: float

    def due(self, now: int) -> int:
        """The newest step that is due, 0 before the start."""
        if self.start_ns is None or now < self.start_ns:
            return 0
        return int((now - self.start_ns) * self.rate / 1e9) + 1

    def time_of(self, step: int) -> int | None:
        """When a step is due, in nanoseconds."""
        return None if self.start_ns is None else self.start_ns + int((step - 1) / self.rate * 1e9)


@dataclass(frozen=True)
class GridSchedule:
    """Step k is due at its own time t_k, as in a mesh with live sources."""

    grid: Grid

    def due(self, now: int) -> int:
        """The newest step that is due, 0 before t_1."""
        k = self.grid.step_of(now)
        return max(0, k if self.grid.time_of(k) <= now else k - 1)

    def time_of(self, step: int) -> int | None:
        """When a step is due, in nanoseconds."""
        return self.grid.time_of(step)
