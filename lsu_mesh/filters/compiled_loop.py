"""What a filter offers whose steps run in a compiled loop: single runs and banks are made of it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Array, Matrix, Stack
from lsu_mesh.filters.density import Density, noise_covariance
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.validation import kernel_model, with_offset
from lsu_mesh.kernels.run_tables import Estimates, Models, Record
from lsu_mesh.model import LSUModel


class LoopData(NamedTuple):
    """Rows of a bank: Y (N, T, m), U (N, T, p), with a last column of ones where the models have an offset.

    ``updates``: output prediction, data update and record of each row; ``last_prediction``: the last row is followed
    by a time update too; ``points``: points are recorded.
    """

    Y: Stack
    U: Stack
    updates: bool
    last_prediction: bool
    points: bool


class LoopResult(NamedTuple):
    """The record, and outcome (N, 2): rows that are done, and where it stopped (``kernels/run_tables.py``)."""

    record: Record
    outcome: NDArray[np.int64]


class CompiledLoop(Filter):
    """A filter that can do many rows, of many instances, in compiled code with the bits of its single steps.

    Compiled code stops where the data contradict the set, or where it cannot tell; the state is then the one before
    that action, and the action is done, or raises, in Python.
    """

    has_compiled_points: ClassVar[bool] = True
    """Whether the loop computes the points of every rule, else those of ``"centre"`` only."""
    has_compiled_volumes: ClassVar[bool] = True
    min_share: ClassVar[int] = 64
    """Instances of a bank below which a thread of its own does not pay."""

    @property
    def has_compiled_loop(self) -> bool:
        """Whether the loop does what the steps one by one do: not where a step must look at its set."""
        return self.model.has_plain_outputs and self.model.radii is None

    @property
    @abstractmethod
    def loop_state(self) -> Array:
        """The set as one array, whose shape is the same for all filters of a bank; a copy."""

    @abstractmethod
    def hold_loop_state(self, state: Array, density: Density | None) -> None:
        """Hold the set that such an array stands for, and this density beside it."""

    @abstractmethod
    def run_states(
        self, states: Array, models: Models, estimates: Estimates, data: LoopData, result: LoopResult,
        first: int, last: int, kept: Stack,
    ) -> None:  # fmt: skip
        """The rows of the instances first … last − 1, whose states (N, …) and densities are written in place.

        ``kept`` (N, T or 0, line): where posteriors are kept, of filters without compiled volumes.
        """

    @abstractmethod
    def estimates(self, densities: Sequence[Density | None]) -> Estimates:
        """The rule and copies of the densities, as the loop writes them."""

    def snapshot_of(self, state: Array) -> object:
        """A snapshot that holds the set of a kept state; for volumes only."""
        raise NotImplementedError

    def sweep(
        self, Y: Matrix, U: Matrix, record: Record, points: bool = True, sets: list[object] | None = None
    ) -> tuple[int, int]:
        """Update and predict for all rows of Y (T, m), U (T, p); ``record`` has a leading axis 1.

        Returns the rows that are done, and where it stopped; the filter holds the last good state. Without ``points``
        those of the record are left as they are. ``sets`` takes a snapshot of each row, where volumes are not
        compiled.
        """
        states, estimates = self.loop_state[np.newaxis], self.estimates([self.density])
        outcome = np.zeros((1, 2), dtype=np.int64)
        rows = 0 if sets is None or self.has_compiled_volumes else len(Y)
        kept = np.empty((1, rows, states.shape[-1]))
        self.run_states(
            states, stacked_models([self.model]), estimates,
            LoopData(Y[np.newaxis], with_offset(self.model, U)[np.newaxis], True, False, points=points),
            result=LoopResult(record, outcome), first=0, last=1, kept=kept,
        )  # fmt: skip
        done, where = int(outcome[0, 0]), int(outcome[0, 1])
        density = self.density
        if density is not None:
            density = Density(estimates.means[0], estimates.covariances[0])
        self.hold_loop_state(states[0], density)
        if rows and sets is not None:
            sets.extend(self.snapshot_of(kept[0, row]) for row in range(done))
        return done, where


def stacked_models(models: Sequence[LSUModel]) -> Models:
    """Arrays of models of equal shapes with a leading axis."""
    arrays: Any = [kernel_model(model) for model in models]
    n = models[0].state_count
    domains = [_sides(model) for model in models if model.domain is not None]
    return Models(
        A=np.array([one.A for one in arrays]),
        B=np.array([one.B for one in arrays]),
        C=np.array([one.C for one in arrays]),
        G=np.array([one.G for one in arrays]),
        widths=np.array([one.widths for one in arrays]),
        r=np.array([one.r for one in arrays]),
        domains=np.array(domains) if domains else np.zeros((len(models), 0, n)),
        Q=np.array([noise_covariance(model, None) for model in models]),
    )


def _sides(model: LSUModel) -> list[Array]:
    """Lower, upper, centre and half-widths (n,) of the domain."""
    domain = model.domain
    assert domain is not None
    return [domain.lower, domain.upper, domain.center, domain.half_widths]
