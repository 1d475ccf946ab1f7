"""What a configuration says, checked and typed. The meaning of each field stands in ``docs/configuration.md``."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lsu_mesh.filters.filter import GainOf
from lsu_mesh.filters.grid import OffGrid
from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.config.digest import digest
from lsu_mesh.mesh.config.instances import Instances
from lsu_mesh.mesh.config.problem import Problem
from lsu_mesh.mesh.data_files.moments import exact_dt, start_time_ns
from lsu_mesh.mesh.data_files.settings import DataFileSettings
from lsu_mesh.mesh.grid import Grid
from lsu_mesh.mesh.ros2.settings import Ros2Network, Ros2Topic
from lsu_mesh.model import ContinuousModel, LSUModel
from lsu_mesh.supports.orthotope import Orthotope

TransferWay = Literal["off", "predictor", "fused", "data-predictor"]
"""What a filter takes from others: nothing, their predictions, fused boxes, or their output predictors."""
OnInconsistency = Literal["reset", "hold", "widen"]
"""What a filter does when data go on contradicting its set."""
FaultKind = Literal["bias", "drift", "stuck", "random", "lost"]
"""A simulated fault of a sensor."""
Source = Literal["simulated", "file", "external", "ros2"]
"""Where measurements come from: the mesh simulates them, plays them, or a program sends them."""
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
    exact_dt: Fraction | None = None
    """``dt`` exactly as it is written, in seconds; ``None``: the decimal of ``dt``."""
    start_ns: int | None = None
    """t_0 in nanoseconds since 1970, exactly as ``start_time`` is written, or as the peers have agreed on it."""
    starts_now: bool = False
    """``start_time = "now"``: the peers agree on t_0 when they start."""
    is_live: bool = False
    """Step k is due at t_k, by the clock: a source is a program, or the mesh starts now."""
    future_ns: int = 2 * 10**9
    past_ns: int = 8 * 10**9
    """So far may the time of a live datum lie ahead of the receiver's clock, and behind it."""


@dataclass(frozen=True)
class PlantSettings:
    """``[plant]``; ``inputs`` is "normal", "sine", "zero" or a file."""

    name: str
    x1: tuple[float, ...] | None
    inputs: str
    file: MeasurementFileSettings | None
    is_external: bool = False
    """A program of its own sends the inputs."""


MeasurementFileSettings = DataFileSettings
"""Where recorded values lie; nothing of the file is read to hold them."""


@dataclass(frozen=True)
class SensorFault:
    """A fault at steps first … last: bias, drift (per step), stuck, random, or lost; ``instances``: of these only."""

    kind: FaultKind
    first: int
    last: int
    size: float
    instances: tuple[int, ...] = ()


@dataclass(frozen=True)
class SensorSettings:
    """``[sensors.NAME]``; rows of C with half-widths r; simulated when ``file`` is None and it is not ``live``."""

    name: str
    C: tuple[tuple[float, ...], ...]
    r: tuple[float, ...]
    outputs: tuple[str, ...]
    file: MeasurementFileSettings | None
    faults: tuple[SensorFault, ...]
    simulated_r: tuple[float, ...] = ()
    """Half-widths of the simulated noise, where they are not r."""
    D: tuple[tuple[float, ...], ...] = ()
    """Rows of the feedthrough, one per row of C; empty: none."""
    offset: tuple[float, ...] = ()
    """d of ``y = C x + D u + d + v``; empty: 0."""
    period: tuple[float, ...] = ()
    """Periods of the outputs (360, 2π), 0 where an output has none; empty: none has."""
    time_error_ns: int = 0
    """Half-width of what is not known of the times of its measurements."""
    rate: tuple[float, ...] = ()
    """Bound of the noise-free outputs' |dy/dt|, by which a discrete model may use data off the grid; empty: none."""
    off_grid: OffGrid = "refuse"
    """What a discrete model does with data off the grid and without ``rate``."""
    tolerance_ns: int | None = None
    """So far from t_k a datum is of step k by declaration; ``None``: half a unit of the last digit of its times."""
    every_ns: int | None = None
    """Simulated: measures at multiples of this from ``t_0`` on, and not at every step."""
    jitter_ns: int = 0
    """Simulated: the moment of a measurement lies up to so much after its turn."""
    clock_error_ns: int = 0
    """Simulated: its stamps are wrong by up to so much."""
    live: Literal["", "external", "ros2"] = ""
    """The kind of program that sends its measurements; empty: the mesh simulates or plays them."""
    ros2: Ros2Topic | None = None
    """The topic that it listens to, of a sensor whose ``live`` is "ros2"."""

    @property
    def source(self) -> Source:
        """Where its measurements come from."""
        if self.live:
            return self.live
        return "simulated" if self.file is None else "file"

    @property
    def is_live(self) -> bool:
        """Whether its measurements come from a program, at times of their own."""
        return self.live != ""

    @property
    def is_simulated(self) -> bool:
        """Whether the mesh simulates it on the plant's truth."""
        return self.source == "simulated"

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
    on_inconsistency: OnInconsistency
    reset_after: int
    options: Mapping[str, Any]
    adopt: str = ""
    """The identifier whose bounds are adopted."""
    transfer_gain: GainOf = "hull"
    """Whose volumes the published gain of transfers compares."""
    publish_when: float = 0.0
    """Nats that a prediction has to gain on what others hold of the one published last; 0: each is published."""
    instances: int = 0
    """N of a bank; 0: one filter."""

    @property
    def lag(self) -> int:
        """L of fixed-lag smoothing, the option of a class that smooths; 0: it publishes no smoothed sets."""
        return int(self.options.get("lag", 0)) if filter_class(self.kind).smooths else 0


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
    point: PointRule = "mean"


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
    """``[recorder]``; ``path`` may hold ``{mesh}`` and ``{time}``; a part has bytes and seconds, 0: without limit."""

    path: str = "runs/{mesh}-{time}.rrd"
    flush: float = 1.0
    mesh_hz: float = 10.0
    axes: tuple[str, ...] = ()
    draw_hz: float = 10.0
    part_size: int = 10**9
    part_time: float = 3600.0
    predictions: bool = False


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
    ros2: Ros2Network = field(default_factory=Ros2Network)
    """Another network, of which sensors with ``source = "ros2"`` are a part too."""


@dataclass(frozen=True)
class SupervisorSettings:
    """``[supervisor]``; whether and how often a child that died is started again."""

    restart: bool = True
    backoff: float = 0.5
    limit: int = 3


@dataclass(frozen=True)
class ScheduledModel:
    """``[[model.schedule]]``: the model, without outputs, that is in force from step ``first`` on."""

    first: int
    model: LSUModel | ContinuousModel


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
    warnings: tuple[Problem, ...] = ()
    """What is legal and yet probably not meant."""
    values: Mapping[str, Any] = field(default_factory=dict, compare=False)
    """The TOML values that all of this was read from, flags and environment included."""

    identifiers: Mapping[str, IdentifierSettings] = field(default_factory=dict)
    continuous: ContinuousModel | None = None
    """Of ``[model] continuous = true``, without outputs; ``base_model`` then is that of the first step."""
    schedule: tuple[ScheduledModel, ...] = ()
    """Models that replace the first one from a step on, in order."""
    input_delay_ns: int = 0
    """An input may take so long to act after its step began."""
    instances: Instances | None = None

    @functools.cached_property
    def grid(self) -> Grid:
        """``t_k = start + k dt`` in nanoseconds."""
        mesh = self.mesh
        dt = exact_dt(mesh.dt) if mesh.exact_dt is None else mesh.exact_dt
        if mesh.start_ns is not None:
            return Grid(mesh.start_ns, dt)
        return Grid(0 if mesh.start_time is None else start_time_ns(mesh.start_time)[0], dt)

    def flow(self, k: int) -> ContinuousModel | None:
        """The continuous model in force from t_k on; ``None`` for discrete models."""
        found = self.continuous
        for entry in self.schedule:
            if entry.first <= k and isinstance(entry.model, ContinuousModel):
                found = entry.model
        return found

    def stretch_model(self, k: int) -> LSUModel:
        """The model without outputs that drives step k to k + 1; ``base_model`` where there is no other."""
        flow = self.flow(k)
        if flow is not None:
            return flow.discretised(self.grid.time_of(k + 1) - self.grid.time_of(k))
        found = self.base_model
        for entry in self.schedule:
            if entry.first <= k and isinstance(entry.model, LSUModel):
                found = entry.model
        return found

    @property
    def awaits_start(self) -> bool:
        """Whether t_0 is still to be agreed on."""
        return self.mesh.starts_now and self.mesh.start_ns is None

    def started(self, start_ns: int) -> Configuration:
        """The same mesh with t_0 ≥ 0 known, in its values too, so that a recording holds it."""
        moment = f"{start_ns // 10**9}.{start_ns % 10**9:09d}"
        table = {key: value for key, value in self.values.get("mesh", {}).items() if key != "start_time"}
        mesh = replace(self.mesh, start_ns=start_ns, start_time=float(Fraction(start_ns, 10**9)))
        return replace(self, mesh=mesh, values={**self.values, "mesh": {**table, "start_time": moment}})

    def is_live(self, topic: str, name: str) -> bool:
        """Whether messages of a topic and name come from a program, whose clock nobody of the mesh knows."""
        if topic in ("measurement", "bank_measurement"):
            return name in self.sensors and self.sensors[name].is_live
        return topic == "input" and self.plant is not None and self.plant.is_external and name == self.plant.name

    def is_external(self, role: str, name: str) -> bool:
        """Whether a peer is a program of somebody else, which nobody of the mesh starts."""
        if role == "sensor":
            return self.sensors[name].live == "external"
        return role == "plant" and self.plant is not None and self.plant.is_external

    @property
    def has_one_model(self) -> bool:
        """Whether every step is driven by ``base_model`` itself, as of a discrete model without a schedule."""
        return self.continuous is None and not self.schedule

    def model(self, sensors: Iterable[str]) -> LSUModel:
        """The model whose rows of C are those of the named sensors, in the order of their names."""
        chosen = [self.sensors[name] for name in sorted(sensors)]
        rows = [row for sensor in chosen for row in sensor.C]
        further: dict[str, Any] = {}
        if any(sensor.D for sensor in chosen):
            p = self.base_model.input_count
            further["D"] = [row for sensor in chosen for row in (sensor.D or [(0.0,) * p] * len(sensor.C))]
        if any(sensor.offset for sensor in chosen):
            further["d"] = [d for sensor in chosen for d in (sensor.offset or (0.0,) * len(sensor.C))]
        if any(sensor.period for sensor in chosen):
            further["period"] = [d for sensor in chosen for d in (sensor.period or (0.0,) * len(sensor.C))]
        return self.base_model.replace(
            C=np.array(rows).reshape(len(rows), self.base_model.state_count),
            r=[width for sensor in chosen for width in sensor.r],
            outputs=[name for sensor in chosen for name in sensor.outputs],
            **further,
        )

    @functools.cached_property
    def _outputs(self) -> Mapping[str, LSUModel]:
        return {name: self.model([name]) for name in self.sensors}

    def outputs(self, sensor: str) -> LSUModel:
        """The outputs of one sensor: C, D, d, period and r of its rows, with the dynamics of ``base_model``."""
        return self._outputs[sensor]

    @property
    def cached(self) -> int:
        """Messages per key that a publisher keeps for those who come late, or who missed them."""
        given, least = self.network.cache, LEAST_CACHED if self.instances is None else 1
        return given if given is not None else max(least, math.ceil(CACHED_SECONDS * self.mesh.rate))

    def digest(self) -> str:
        """16 hexadecimal characters over the mathematics of the mesh, not over bounds; see ``docs/protocol.md``."""
        return digest(self)

    def peers(self) -> list[tuple[str, str]]:
        """``(role, name)`` of every peer, in the order in which they are started."""
        groups = (("fusion", [*self.fusion]), ("identifier", [*self.identifiers]), ("filter", [*self.filters]))
        listed = [("recorder", "recorder"), *((role, name) for role, names in groups for name in names)]
        listed += [("sensor", name) for name in self.sensors]
        if self.plant is not None:
            listed.append(("plant", self.plant.name))
        return listed
