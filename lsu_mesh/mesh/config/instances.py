"""The instances of a bank: how many there are, and what each of them has of its own."""

from __future__ import annotations

from dataclasses import dataclass

from lsu_mesh.array_types import Matrix, Stack
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

OWN_KEYS = ("lower", "upper", "A", "rho", "x1")
"""Parts of ``[model.instances]``."""


@dataclass(frozen=True, eq=False)
class Instances:
    """N instances; a part that is ``None`` is the same for all of them, as ``[model]`` and ``[model.prior]`` say."""

    count: int
    lower: Matrix | None = None
    upper: Matrix | None = None
    """Priors (N, n) of x_1."""
    A: Stack | None = None
    """Matrices (N, n, n)."""
    rho: Matrix | None = None
    """Half-widths (N, q) of the process noise."""
    x1: Matrix | None = None
    """True states (N, n) of step 1, for the simulation."""

    def priors(self, prior: Orthotope) -> list[Orthotope]:
        """A prior per instance."""
        if self.lower is None or self.upper is None:
            return [prior] * self.count
        return [Orthotope(*pair) for pair in zip(self.lower, self.upper, strict=True)]

    def models(self, model: LSUModel) -> list[LSUModel]:
        """One model for all instances, or one per instance."""
        if self.A is None and self.rho is None:
            return [model]
        A = [model.A] * self.count if self.A is None else self.A
        rho = [model.rho] * self.count if self.rho is None else self.rho
        return [model.replace(A=matrix, rho=widths) for matrix, widths in zip(A, rho, strict=True)]

    def same(self, other: object) -> bool:
        """Whether another one has the same numbers."""
        if not isinstance(other, Instances) or self.count != other.count:
            return False
        pairs = [(getattr(self, key), getattr(other, key)) for key in OWN_KEYS]
        return all((a is None) == (b is None) and (a is None or (a == b).all()) for a, b in pairs)
