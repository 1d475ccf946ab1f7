"""What a continuous model's rho comes to in one dt: a rate copied from a discrete model is seen at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.data_files.spans import duration_text


@dataclass(frozen=True)
class StepNoise:
    """Half-widths of the hull of ``∫₀^dt e^{As} N w ds``, by state, and the rho (q,) of that model."""

    first: int
    """The step from which the model is in force."""
    dt_ns: int
    states: Mapping[str, float]
    rho: tuple[float, ...]

    def line(self) -> str:
        """For people."""
        widths = ", ".join(f"{name} {width:.4g}" for name, width in self.states.items())
        rates = ", ".join(f"{rate:g}" for rate in self.rho)
        later = f" from step {self.first} on" if self.first > 1 else ""
        return (
            f"[model] noise of one dt ({duration_text(self.dt_ns)}){later}, in state units: {widths}; "
            f"rho is a rate, per second: {rates}"
        )

    def as_record(self) -> dict[str, Any]:
        """For a line of JSON."""
        return {"from": self.first, "dt_ns": self.dt_ns, "states": dict(self.states), "rho": list(self.rho)}


def noise_of_one_dt(configuration: Configuration) -> list[StepNoise]:
    """Of the first model and of each that the schedule brings; empty for discrete models."""
    found = []
    for first in (1, *(entry.first for entry in configuration.schedule)):
        flow = configuration.flow(first)
        if flow is None:
            return []
        length = configuration.grid.time_of(first + 1) - configuration.grid.time_of(first)
        step = flow.discretised(length)
        generators = np.eye(step.state_count) if step.noise_map is None else step.noise_map
        widths = np.abs(generators) @ step.rho
        states = dict(zip(step.states, widths.tolist(), strict=True))
        found.append(StepNoise(first, length, states, tuple(flow.rates.rho.tolist())))
    return found
