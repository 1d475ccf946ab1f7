"""One step of a bank, shared by the node and by the verification: the data of all instances, and what contradicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lsu_mesh.array_types import Counts, Flags, Matrix, Vector
from lsu_mesh.filters.bank import FilterBank
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.bank_messages import (
    INCONSISTENT,
    OK,
    PREDICTED,
    RESTARTED,
    BankMeasurement,
    BankPosterior,
    packed,
)
from lsu_mesh.mesh.config.settings import Configuration, FilterSettings
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support


@dataclass(frozen=True)
class BankStep:
    """The sets of all instances after a step's data.

    points, lower, upper (N, n), log_volumes (N,) with NaN for none, statuses (N,); ``contradicted`` are instances whose
    data were not used, ``reset`` those that were started again, ``lost`` those that have nothing to start from.
    """

    points: Matrix
    lower: Matrix
    upper: Matrix
    log_volumes: Vector
    statuses: bytes
    contradicted: Counts
    reset: Counts
    lost: Counts


class BankEngine:
    """A :class:`FilterBank` by a configuration, with what each instance remembers besides its set.

    Data that contradict an instance's set are not used for it; its set is the prediction then. After ``reset_after``
    such steps in a row the instance starts again from the domain, or is lost where there is none: nothing is promised
    of its set from then on. A prediction that misses the domain, or outgrows all numbers, is a reset too.
    """

    def __init__(self, configuration: Configuration, settings: FilterSettings, priors: Sequence[Support]) -> None:
        assert configuration.instances is not None
        self._sensors = settings.sensors
        self._rows = [len(configuration.sensors[name].C) for name in settings.sensors]
        self._reset_after = settings.reset_after if settings.on_inconsistency == "reset" else None
        self._domain = configuration.base_model.domain
        kind: Any = filter_class(settings.kind)
        models = configuration.instances.models(configuration.model(settings.sensors))
        self.bank = FilterBank(kind, models, list(priors), threads=1, **settings.options)
        self.kind = settings.kind
        self.algorithm = int(kind.algorithm)
        n = len(self.bank)
        self._in_a_row = np.zeros(n, dtype=np.int64)
        self._restarted = np.zeros(n, dtype=np.bool_)
        self._lost = np.zeros(n, dtype=np.bool_)
        self._form = _form(self.bank)

    def restarts(self, doubtful: Flags) -> None:
        """The sets are those of another process: the first posterior of each says so.

        ``doubtful`` ones (N,) are not to believe; they start from the domain, or are lost where there is none.
        """
        self._restarted[:] = True
        self._start_again(np.flatnonzero(doubtful))

    def step(self, data: Mapping[str, BankMeasurement]) -> BankStep:
        """Data update with the messages of the step by sensor; who is missing has measured nothing."""
        n = len(self.bank)
        Y = np.full((n, sum(self._rows)), np.nan)
        first = 0
        for name, count in zip(self._sensors, self._rows, strict=True):
            if name in data:
                Y[:, first : first + count] = data[name].matrix("y")
            first += count
        record, done = self.bank.run(Y[:, np.newaxis])
        points, lower, upper, volumes = (
            record.points[:, 0],
            record.lower[:, 0],
            record.upper[:, 0],
            record.volumes[:, 0],
        )
        has_data, contradicted = ~np.isnan(Y).all(axis=1), done < 1
        self._in_a_row = np.where(contradicted, self._in_a_row + 1, np.where(has_data, 0, self._in_a_row))
        reset = self._reset_contradicted()
        kept = np.flatnonzero(contradicted)
        if kept.size:
            points[kept], lower[kept], upper[kept] = self.bank.estimates(kept.tolist())
            volumes[kept] = np.nan
        statuses = np.where(has_data, OK, PREDICTED)
        statuses[contradicted] = INCONSISTENT
        fresh = self._restarted & (~contradicted | np.isin(np.arange(n), reset))
        statuses[fresh] = RESTARTED
        statuses[self._lost] = INCONSISTENT
        self._restarted &= ~fresh
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.log(volumes)
        logs[~np.isfinite(logs)] = np.nan
        return BankStep(
            points, lower, upper, logs, statuses=statuses.astype(np.uint8).tobytes(),
            contradicted=kept, reset=reset, lost=np.flatnonzero(self._lost),
        )  # fmt: skip

    def predict(self) -> Counts:
        """Time update of all instances; those whose prediction fails start again from the domain, and are returned."""
        failed = np.flatnonzero(~self.bank.predict() & ~self._lost)
        self._start_again(failed)
        return failed

    def fields(self, step: BankStep) -> dict[str, Any]:
        """The fields of a posterior that the sets give."""
        center = generators = None
        if self._form == "parallelotope":
            sets = [self.bank.support(i) for i in range(len(self.bank))]
            bodies = [one for one in sets if isinstance(one, Parallelotope)]
            center = packed(np.array([one.center for one in bodies]))
            generators = packed(np.array([one.generators for one in bodies]))
        return {
            "kind": self.kind,
            "support": self._form,
            "center": center,
            "generators": generators,
            "lower": packed(step.lower),
            "upper": packed(step.upper),
            "point": packed(step.points),
            "log_volume": packed(step.log_volumes),
            "volume_of": "hull" if self._form == "hull" else "support",
            "statuses": step.statuses,
            "point_rule": self.bank.point_rule,
            "algorithm": self.algorithm,
        }

    def _reset_contradicted(self) -> Counts:
        """Instances that start again after so many contradictions in a row."""
        if self._reset_after is None:
            return np.zeros(0, dtype=np.int64)
        due = np.flatnonzero((self._in_a_row >= self._reset_after) & ~self._lost)
        self._start_again(due)
        return due if self._domain is not None else due[:0]

    def _start_again(self, rows: Counts) -> None:
        self._in_a_row[rows] = 0
        if not rows.size:
            return
        if self._domain is None:
            self._lost[rows] = True
            return
        self.bank.reset(rows.tolist(), self._domain)
        self._restarted[rows] = True


def warm_up_bank(configuration: Configuration, settings: FilterSettings) -> None:
    """Load the kernels of a bank with a bank of one instance, which is forgotten."""
    kind: Any = filter_class(settings.kind)
    model = configuration.model(settings.sensors)
    bank = FilterBank(kind, model, [configuration.prior], threads=1, **settings.options)
    bank.run(np.full((1, 1, model.output_count), np.nan))
    bank.predict()
    bank.estimates([0])


def _form(bank: FilterBank) -> str:
    """What the sets of a bank are in a message."""
    first = bank.support(0)
    return (
        "orthotope" if isinstance(first, Orthotope) else "parallelotope" if isinstance(first, Parallelotope) else "hull"
    )


def published_sets(message: BankPosterior) -> list[Support]:
    """The sets of a message, from which a bank may start again: each holds the state of its instance."""
    if message.support != "parallelotope":
        return [Orthotope(*pair) for pair in zip(message.matrix("lower"), message.matrix("upper"), strict=True)]
    n = message.matrix("lower").shape[1]
    centers, generators = message.matrix("center"), message.matrix("generators").reshape(-1, n, n)
    return [Parallelotope(*pair) for pair in zip(centers, generators, strict=True)]
