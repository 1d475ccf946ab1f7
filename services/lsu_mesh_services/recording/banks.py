"""What is drawn of banks: quantiles of the widths of all targets, how many are not consistent, bands of a few targets.

The messages themselves are kept whole as raw payloads; drawings are thinned to ``recorder.mesh_hz``.
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np
import rerun as rr

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.mesh.bank_messages import INCONSISTENT, RESTARTED, BankSets, BankTruth
from lsu_mesh_services.recording.bands import band_columns, band_style, line_style
from lsu_mesh_services.recording.entity_paths import EntityPaths, path
from lsu_mesh_services.recording.palette import TRUTH, Color
from lsu_mesh_services.recording.timeline import Moment, Stream, Timelines

SHOWN = 3
"""Targets whose bands are drawn: the first ones."""
QUANTILES = (0.5, 0.95, 1.0)
"""Of the mean widths of all targets."""


class _Row(NamedTuple):
    moment: Moment
    quantiles: Vector
    counts: Vector
    """Targets that are inconsistent, and that were restarted."""
    bands: Matrix
    """lower, point and upper of the targets that are shown (3, shown, n)."""


class BankDrawings:
    """Collects rows of banks and sends them in batches."""

    def __init__(self, stream: Stream, timelines: Timelines, names: EntityPaths, colors: dict[str, Color]) -> None:
        self._stream, self._timelines, self._names = stream, timelines, names
        self._rows: defaultdict[str, list[_Row]] = defaultdict(list)
        self._truths: list[tuple[Moment, Matrix]] = []
        self._apart_ns = int(1e9 / names.configuration.recorder.mesh_hz)
        self._drawn: dict[str, int] = {}
        """By source, when its last drawing arrived."""
        if names.configuration.instances is not None:
            self._style(colors)

    def add(self, message: BankSets, arrival_ns: int) -> None:
        """The sets of a bank or of a fusion of banks."""
        if self._is_too_early(message.src, arrival_ns):
            return
        lower, upper = message.matrix("lower"), message.matrix("upper")
        statuses = message.status_codes
        believed = statuses != INCONSISTENT
        widths = (upper - lower).mean(axis=1)[believed]
        quantiles = np.quantile(widths, QUANTILES) if widths.size else np.full(len(QUANTILES), np.nan)
        counts = np.array([float((~believed).sum()), float((statuses == RESTARTED).sum())])
        bands = np.array([one[:SHOWN] for one in (lower, message.matrix("point"), upper)])
        self._rows[message.name].append(_Row(Moment(message.step, arrival_ns), quantiles, counts, bands))

    def add_truth(self, message: BankTruth, arrival_ns: int) -> None:
        """The true states of the targets that are shown."""
        if not self._is_too_early(message.src, arrival_ns):
            self._truths.append((Moment(message.step, arrival_ns), message.matrix("x")[:SHOWN].copy()))

    def flush(self) -> None:
        """Send all rows that wait."""
        rows, self._rows = self._rows, defaultdict(list)
        truths, self._truths = self._truths, []
        for peer, listed in rows.items():
            times = self._timelines.columns([row.moment for row in listed])
            quantiles, counts = np.array([row.quantiles for row in listed]), np.array([row.counts for row in listed])
            self._stream.send_columns(path("bank_widths", peer), times, rr.Scalars.columns(scalars=quantiles))
            self._stream.send_columns(path("bank_counts", peer), times, rr.Scalars.columns(scalars=counts))
            bands = np.array([row.bands for row in listed])
            for i in range(bands.shape[2]):
                for j, state in enumerate(self._names.states):
                    lower, point, upper = (bands[:, part, i, j] for part in range(3))
                    self._stream.send_columns(band_entity(i, state, peer), times, band_columns(lower, point, upper))
        if truths:
            times = self._timelines.columns([moment for moment, _ in truths])
            states = np.array([x for _, x in truths])
            for i in range(states.shape[1]):
                for j, state in enumerate(self._names.states):
                    columns = rr.Measurements.columns(values=states[:, i, j], variances=np.zeros(len(states)))
                    self._stream.send_columns(truth_entity(i, state), times, columns)

    def _is_too_early(self, source: str, arrival_ns: int) -> bool:
        if arrival_ns - self._drawn.get(source, -self._apart_ns) < self._apart_ns:
            return True
        self._drawn[source] = arrival_ns
        return False

    def _style(self, colors: dict[str, Color]) -> None:
        configuration = self._names.configuration
        assert configuration.instances is not None
        quantiles = ["median", *(f"{100 * share:g} %" for share in QUANTILES[1:-1]), "widest"]
        for peer in self._names.estimators:
            named = rr.SeriesLines(colors=[colors[peer]] * len(QUANTILES), widths=[2.0, 1.5, 1.0], names=quantiles)
            self._stream.log(path("bank_widths", peer), named, static=True)
            named = rr.SeriesLines(widths=[1.5, 1.5], names=["inconsistent", "restarted"])
            self._stream.log(path("bank_counts", peer), named, static=True)
            for i in range(min(SHOWN, configuration.instances.count)):
                for state in self._names.states:
                    self._stream.log(band_entity(i, state, peer), band_style(peer, colors[peer]), static=True)
        for i in range(min(SHOWN, configuration.instances.count)):
            for state in self._names.states:
                self._stream.log(truth_entity(i, state), line_style("truth", TRUTH, 1.5), static=True)


def band_entity(target: int, state: str, peer: str) -> str:
    """Entity of the band of one target."""
    return path("targets", str(target), state, *("bands", peer))


def truth_entity(target: int, state: str) -> str:
    """Entity of the true state of one target."""
    return path("targets", str(target), state, "truth")
