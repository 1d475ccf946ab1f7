"""The report of a run of banks: one row per bank, over all of its instances."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from lsu_mesh.mesh.bank_messages import INCONSISTENT, BankSets, BankTruth
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Message
from lsu_mesh_services.monitoring.run_report import Row, RunReport, Track

KEPT = 64
"""Steps whose sets or truth wait for the other."""


@dataclass
class _Sums:
    """Of one bank, over steps and instances."""

    steps: int = 0
    sets: int = 0
    width: float = 0.0
    known: int = 0
    missed: int = 0
    squares: float = 0.0
    inconsistent: int = 0
    waiting: dict[int, BankSets] = field(default_factory=dict)


class BankReport(RunReport):
    """Sums of what banks published; what is not consistent is not counted as a set."""

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(configuration)
        self._sums = {name: _Sums() for name in self.tracks}
        self._truths: dict[int, BankTruth] = {}

    def record(self, message: Message, arrival_ns: int) -> None:
        """Take a message that was let through before."""
        if isinstance(message, BankTruth):
            self._truths[message.step] = message
            _forget(self._truths)
            for sums in self._sums.values():
                if (sets := sums.waiting.pop(message.step, None)) is not None:
                    _compare(sums, sets, message)
        elif isinstance(message, BankSets):
            self._record_sets(message, arrival_ns)
        else:
            super().record(message, arrival_ns)

    def _record_sets(self, message: BankSets, arrival_ns: int) -> None:
        track, sums = self.tracks[message.name], self._sums[message.name]
        track.newest = max(track.newest, message.step)
        track.latencies_ms.add((arrival_ns - message.origin_ns) * 1e-6)
        self.used.update(reference[1].rpartition("/")[2] for reference in message.used)
        believed = message.status_codes != INCONSISTENT
        sums.steps += 1
        sums.sets += int(believed.sum())
        sums.inconsistent += int((~believed).sum())
        sums.width += float((message.matrix("upper") - message.matrix("lower")).mean(axis=1)[believed].sum())
        truth = self._truths.get(message.step)
        if truth is None:
            sums.waiting[message.step] = message
            _forget(sums.waiting)
        else:
            _compare(sums, message, truth)

    def _row(self, name: str, track: Track, restarts: int) -> Row:
        sums, row = self._sums[name], super()._row(name, track, restarts)
        return Row(
            name=name,
            role=track.role,
            kind=f"{track.kind} × {len_of(self.configuration)}",
            steps=sums.steps,
            last_step=track.newest,
            rmse=math.sqrt(sums.squares / sums.known) if sums.known else None,
            inside=1.0 - sums.missed / sums.known if sums.known else None,
            width=sums.width / sums.sets if sums.sets else None,
            latency_p50_ms=row.latency_p50_ms,
            latency_p99_ms=row.latency_p99_ms,
            gaps=row.gaps,
            refused=row.refused,
            inconsistent=sums.inconsistent,
            restarts=restarts,
        )


def len_of(configuration: Configuration) -> int:
    """N"""
    return 0 if configuration.instances is None else configuration.instances.count


def _compare(sums: _Sums, sets: BankSets, truth: BankTruth) -> None:
    x, believed = truth.matrix("x"), sets.status_codes != INCONSISTENT
    inside = ((sets.matrix("lower") <= x) & (x <= sets.matrix("upper"))).all(axis=1)
    sums.known += int(believed.sum())
    sums.missed += int((~inside & believed).sum())
    sums.squares += float(np.square(sets.matrix("point") - x).mean(axis=1)[believed].sum())


def _forget(waiting: dict[int, BankTruth] | dict[int, BankSets]) -> None:
    while len(waiting) > KEPT:
        del waiting[next(iter(waiting))]
