"""When a simulated sensor measures, and what its clock says then."""

from __future__ import annotations

from typing import NamedTuple

from lsu_mesh.mesh.config.settings import SensorSettings
from lsu_mesh.mesh.grid import Grid
from lsu_mesh.simulation import random_uniform


class Moment(NamedTuple):
    """A measurement: its number, when it is made, and what the clock says; nanoseconds."""

    number: int
    time_ns: int
    stamp_ns: int


class SensorClock:
    """Moments that are functions of (seed, name, number), the same after a restart.

    Turn ``i`` is t_i of the grid, or ``t_0 + i every``. The true moment lies up to ``jitter`` after it, the stamp up to
    ``clock_error`` before or after the true moment, both uniform.
    """

    def __init__(self, settings: SensorSettings, grid: Grid, seed: int) -> None:
        self._settings = settings
        self._grid = grid
        self._seed = seed

    @property
    def is_on_grid(self) -> bool:
        """Whether it measures at every t_k, and says so."""
        settings = self._settings
        return settings.every_ns is None and settings.jitter_ns == 0 and settings.clock_error_ns == 0

    @property
    def most_per_step(self) -> int:
        """Measurements that a step may have."""
        every = self._settings.every_ns
        step = self._grid.time_of(2) - self._grid.time_of(1)
        return 2 if every is None else (step + self._settings.jitter_ns) // every + 2

    def between(self, first_ns: int, last_ns: int) -> list[Moment]:
        """Measurements whose true moment is in ``[first_ns, last_ns)``, in order."""
        turns = range(self._turn_at(first_ns - self._settings.jitter_ns), self._turn_at(last_ns) + 1)
        moments = (self._moment(i) for i in turns if i >= 0)
        return sorted((one for one in moments if first_ns <= one.time_ns < last_ns), key=lambda one: one.time_ns)

    def _moment(self, i: int) -> Moment:
        late, off = random_uniform(self._seed, f"{self._settings.name}/moment", i, 2)
        true = self._turn(i) + int(0.5 * (late + 1.0) * self._settings.jitter_ns)
        return Moment(i, true, true - int(off * self._settings.clock_error_ns))

    def _turn(self, i: int) -> int:
        every = self._settings.every_ns
        return self._grid.time_of(i) if every is None else self._grid.start_ns + i * every

    def _turn_at(self, time_ns: int) -> int:
        """The last turn that is not after a time."""
        every = self._settings.every_ns
        if every is not None:
            return (time_ns - self._grid.start_ns) // every
        k = self._grid.step_of(time_ns)
        return k if self._grid.time_of(k) == time_ns else k - 1
