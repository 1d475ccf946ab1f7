"""What a configuration says, checked and typed. The meaning of each field stands in ``docs/configuration.md``."""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

Matrix = NDArray[np.float64]
TransferWay = Literal["off", "predictor", "fused", "data-predictor"]
"""What a filter takes from others: nothing, their predictions, fused boxes, or their output predictors."""
OnContradiction = Literal["reset", "hold", "widen"]
"""What a filter does when data go on contradicting its set."""
FaultKind = Literal["bias", "drift", "stuck", "random", "lost"]
"""A simulated fault of a sensor."""
Learn = Literal["r", "rho", "both"]
"""Which bounds an identifier suggests."""
CACHED_SECONDS, LEAST_CACHED = 6.0, 256
"""So much of the past a publisher keeps: the lease and a reconnection, with room."""


@dataclass(frozen=True)
class MeshSettings:
    """``[mesh]``; times in seconds, ``rate`` in steps per second of wall clock (0: as fast as it goes)."""

    name: str
    dt: float
    steps: int | None
    seed: int
    rate: float
    start_time: float | None


@dataclass(frozen=True)
class PlantSettings:
    """``[plant]``; ``inputs`` is "normal", "sine", "zero" or a file."""

    name: str
    x1: tuple[float, ...] | None
    inputs: str
    file: MeasurementFileSettings | None


@dataclass(frozen=True)
class MeasurementFileSettings:
    """Where recorded values lie: a CSV file, its value columns, and the column that orders them."""

    path: Path
    columns: tuple[str, ...]
    index: str
    indexed_by: str
    """``"time"`` (seconds or ISO 8601) or ``"step"``."""


@dataclass(frozen=True)
class SensorFault:
    """A simulated fault of a sensor at steps first … last: bias, drift (per step), stuck, random, or lost."""

    kind: FaultKind
    first: int
    last: int
    size: float


@dataclass(frozen=True)
class SensorSettings:
    """``[sensors.NAME]``; rows of C with half-widths r; simulated when ``file`` is None."""

    name: str
    C: tuple[tuple[float, ...], ...]
    r: tuple[float, ...]
    outputs: tuple[str, ...]
    file: MeasurementFileSettings | None
    faults: tuple[SensorFault, ...]
    simulated_r: tuple[float, ...] = ()
    """Half-widths of the simulated noise, where they are not r."""

    @property
    def true_r(self) -> tuple[float, ...]:
        """Half-widths of the simulated noise."""
        return self.simulated_r or self.r


@dataclass(frozen=True)
class FilterSettings:
    """``[filters.NAME]``; ``options`` go to the class. ``sensors`` are in the order of their names."""

    name: str
    kind: str
    sensors: tuple[str, ...]
    deadline: float
    history: int
    transfer: TransferWay
    transfer_from: tuple[str, ...]
    """Filters (predictors) or fusions (fused boxes) whose knowledge is transferred."""
    on_contradiction: OnContradiction
    reset_after: int
    options: Mapping[str, Any]
    adopt: str = ""
    """The identifier whose bounds are adopted."""


@dataclass(frozen=True)
class FusionSettings:
    """``[fusion.NAME]``."""

    name: str
    sources: tuple[str, ...]
    policy: str
    faults: int
    max_lag: int
    deadline: float
    quarantine_after: int
    max_generators: int
    max_constraints: int


@dataclass(frozen=True)
class IdentifierSettings:
    """``[identifier.NAME]``; ``window``, ``every`` and ``lead`` in steps."""

    name: str
    sensors: tuple[str, ...]
    learn: Learn
    window: int
    every: int
    margin: float
    lead: int


@dataclass(frozen=True)
class RecorderSettings:
    """``[recorder]``; ``path`` may hold ``{mesh}`` and ``{time}``."""

    path: str = "runs/{mesh}-{time}.rrd"
    flush: float = 0.2
    mesh_hz: float = 10.0
    axes: tuple[str, ...] = ()


@dataclass(frozen=True)
class TlsSettings:
    """``[network.tls]``; files as written, ``{name}`` stands for the peer."""

    enabled: bool = False
    authority: str = "keys/ca.pem"
    certificate: str = "keys/{name}.pem"
    key: str = "keys/{name}.key"
    access_control: bool = True
    verify_hosts: bool = True


@dataclass(frozen=True)
class NetworkSettings:
    """``[network]``; Zenoh endpoints such as ``tcp/127.0.0.1:7447``."""

    entry: str = "tcp/127.0.0.1:7447"
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    cache: int | None = None
    tls: TlsSettings = field(default_factory=TlsSettings)


@dataclass(frozen=True)
class SupervisorSettings:
    """``[supervisor]``; whether and how often a child that died is started again."""

    restart: bool = True
    backoff: float = 0.5
    limit: int = 3


@dataclass(frozen=True)
class Configuration:
    """One mesh: its model, peers and services."""

    path: Path
    mesh: MeshSettings
    base_model: LSUModel
    """The model without outputs."""
    prior: Orthotope
    input_box: Orthotope | None
    plant: PlantSettings | None
    sensors: Mapping[str, SensorSettings]
    filters: Mapping[str, FilterSettings]
    fusion: Mapping[str, FusionSettings]
    recorder: RecorderSettings = field(default_factory=RecorderSettings)
    network: NetworkSettings = field(default_factory=NetworkSettings)
    supervisor: SupervisorSettings = field(default_factory=SupervisorSettings)
    warnings: tuple[str, ...] = ()
    """What is legal and yet probably not meant."""
    values: Mapping[str, Any] = field(default_factory=dict, compare=False)
    """The TOML values that all of this was read from, flags and environment included."""

    identifiers: Mapping[str, IdentifierSettings] = field(default_factory=dict)

    def model(self, sensors: Iterable[str]) -> LSUModel:
        """The model whose rows of C are those of the named sensors, in the order of their names."""
        chosen = [self.sensors[name] for name in sorted(sensors)]
        rows = [row for sensor in chosen for row in sensor.C]
        return self.base_model.replace(
            C=np.array(rows).reshape(len(rows), self.base_model.state_count),
            r=[width for sensor in chosen for width in sensor.r],
            outputs=[name for sensor in chosen for name in sensor.outputs],
        )

    @property
    def cached(self) -> int:
        """Messages per key that a publisher keeps for those who come late, or who missed them."""
        given = self.network.cache
        return given if given is not None else max(LEAST_CACHED, math.ceil(CACHED_SECONDS * self.mesh.rate))

    def digest(self) -> str:
        """16 hexadecimal characters over A, B, C, noise_map and the sensors' rows, not over bounds."""
        state = hashlib.blake2b(digest_size=8)
        for matrix in (self.base_model.A, self.base_model.B, self.base_model.noise_map):
            _digest_matrix(state, matrix)
        for name in sorted(self.sensors):
            state.update(name.encode())
            _digest_matrix(state, np.array(self.sensors[name].C, dtype=np.float64))
        return state.hexdigest()

    def peers(self) -> list[tuple[str, str]]:
        """``(role, name)`` of every peer, in the order in which they are started."""
        listed = [("recorder", "recorder")]
        listed += [("fusion", name) for name in self.fusion]
        listed += [("identifier", name) for name in self.identifiers]
        listed += [("filter", name) for name in self.filters]
        listed += [("sensor", name) for name in self.sensors]
        if self.plant is not None:
            listed.append(("plant", self.plant.name))
        return listed


def _digest_matrix(state: Any, matrix: Matrix | None) -> None:
    shape: Sequence[int] = (0, 0) if matrix is None else matrix.shape
    state.update(struct.pack("<2q", *shape))
    if matrix is not None:
        state.update((matrix + 0.0).astype("<f8").tobytes())
