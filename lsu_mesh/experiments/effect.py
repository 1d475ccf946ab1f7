"""How much a criterion over a grid of noises depends on each of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Effect(NamedTuple):
    """Factors by which a criterion grows from the lowest to the highest noise, geometric means over the other noise."""

    rho: float
    r: float

    @classmethod
    def of(cls, values: NDArray[np.float64]) -> Effect:
        """From positive values (rho levels, r levels)."""
        logs = np.log(values)
        return cls(float(np.exp((logs[-1] - logs[0]).mean())), float(np.exp((logs[:, -1] - logs[:, 0]).mean())))

    @staticmethod
    def difference(values: NDArray[np.float64]) -> Effect:
        """By how much, instead of by which factor, it grows: means over the other noise."""
        return Effect(float((values[-1] - values[0]).mean()), float((values[:, -1] - values[:, 0]).mean()))

    def __str__(self) -> str:
        return f"× {self.rho:.3g} by ρ, × {self.r:.3g} by r"
