"""What the simulated plant of a configuration does: its inputs, and its state at and between the steps."""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.nodes.recorded_inputs import recorded_inputs
from lsu_mesh.simulation import flow_state, input_at, next_state, random_uniform


class PlantCourse:
    """A function of (seed, name, step), so that plant and sensors know it without asking each other.

    A continuous model is followed exactly, with noise that is constant within a step (:func:`flow_state`). Of a
    discrete model nothing is known between steps: there the simulated state moves on a straight line.
    """

    def __init__(self, configuration: Configuration) -> None:
        assert configuration.plant is not None
        self._configuration = configuration
        self._settings = configuration.plant
        file = self._settings.file
        self._recorded = None if file is None else recorded_inputs(configuration, file)

    @property
    def first(self) -> Vector:
        """x_1 (n,)."""
        x1 = self._settings.x1
        return np.array(x1 if x1 is not None else self._configuration.prior.center, dtype=np.float64)

    @property
    def end(self) -> int | None:
        """The last step of the recorded inputs, 0 where they are of no step; ``None`` for simulated ones."""
        return None if self._recorded is None else max(self._recorded, default=0)

    def is_known(self, k: int) -> bool:
        """Whether there is an input of step k: a recording may have none."""
        return self._recorded is None or k in self._recorded

    def input(self, k: int) -> Vector:
        """u_k (p,); 0 where a recording has none."""
        size = self._configuration.base_model.input_count
        if self._recorded is not None:
            return self._recorded.get(k, np.zeros(size))
        seed, name = self._configuration.mesh.seed, self._settings.name
        return input_at(self._settings.inputs, seed, k, size=size, name=f"{name}/input")

    def delay_ns(self, k: int) -> int:
        """So long after t_k does u_k begin to act, and u_{k−1} acts till then; at most a step, 0 in the first."""
        longest = self._configuration.input_delay_ns
        if k <= 1 or longest == 0:
            return 0
        drawn = random_uniform(self._configuration.mesh.seed, f"{self._settings.name}/delay", k, 1)[0]
        return min(int(0.5 * (drawn + 1.0) * longest), self._length_ns(k))

    def next(self, k: int, x: Vector) -> Vector:
        """x_{k+1} (n,) from x_k."""
        return self.after(k, x, self._length_ns(k))

    def after(self, k: int, x: Vector, h_ns: int) -> Vector:
        """The state (n,) ``h_ns`` after t_k, at most at t_{k+1}, from x_k."""
        flow = self._configuration.flow(k)
        if flow is None:
            return self._on_a_line(k, x, h_ns)
        unit = self._unit(k, flow.rates.rho.size)
        late = min(self.delay_ns(k), h_ns)
        if late:
            x = flow_state(flow, x, self.input(k - 1), unit=unit, h_ns=late)
        return flow_state(flow, x, self.input(k), unit=unit, h_ns=h_ns - late)

    def _on_a_line(self, k: int, x: Vector, h_ns: int) -> Vector:
        model = self._configuration.stretch_model(k)
        end = next_state(model, x, self.input(k), self._unit(k, model.rho.size))
        length = self._length_ns(k)
        if h_ns == length:
            return end
        between: Vector = x + (h_ns / length) * (end - x)
        return between

    def _unit(self, k: int, size: int) -> Vector:
        return random_uniform(self._configuration.mesh.seed, f"{self._settings.name}/process", k, size)

    def _length_ns(self, k: int) -> int:
        grid = self._configuration.grid
        return grid.time_of(k + 1) - grid.time_of(k)
