"""The answer to the ``model`` query: what a client must know of a mesh to read its sets."""

from __future__ import annotations

import msgspec
from msgspec import Struct

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import VERSION
from lsu_mesh.model import ContinuousModel, LSUModel


class SensorRows(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One sensor: ``y = C x + D u + d + v``, ``|v| ≤ r``; what is 0 is not told."""

    C: list[list[float]]
    r: list[float]
    outputs: list[str]
    D: list[list[float]] | None = None
    d: list[float] | None = None
    period: list[float] | None = None
    """y is known up to multiples of it; 0 where an output has none."""
    source: str = "simulated"
    """Where its measurements come from; a program may send those of an ``external`` one only."""
    time_error_ns: int = 0
    """What is not known of its times: whoever sends its measurements adds it to each ``time_error_ns``."""


class Dynamics(Struct, frozen=True, kw_only=True):
    """``A x + B u + offset + noise_map w``, ``|w| ≤ rho``: dx/dt of a continuous model, x_(k+1) of a discrete one."""

    A: list[list[float]]
    B: list[list[float]] | None
    offset: list[float] | None
    noise_map: list[list[float]] | None
    rho: list[float]


class LaterModel(Struct, frozen=True, kw_only=True):
    """What is in force from step ``first`` on."""

    first: int
    model: Dynamics


class ModelAnswer(Struct, frozen=True, kw_only=True):
    """``x_(k+1) = A x_k + B u_k + offset + noise_map w_k``, ``|w_k| ≤ rho``, with the names of all its parts.

    Of a continuous model this is its first step, to rounding.
    """

    v: int = VERSION
    model: str
    dt: float
    A: list[list[float]]
    B: list[list[float]] | None
    noise_map: list[list[float]] | None
    rho: list[float]
    states: list[str]
    units: list[str]
    sensors: dict[str, SensorRows]
    start_ns: int | None = None
    """The time of step 0; ``None``: the file has none."""
    boot: str | None = None
    """Of the process that answers."""
    offset: list[float] | None = None
    continuous: Dynamics | None = None
    """The rates of a continuous model; ``None`` for a discrete one."""
    schedule: list[LaterModel] | None = None
    """Models that replace this one later."""
    dt_exact: str | None = None
    """``dt`` as a fraction of seconds, such as ``1/30``; ``None``: the decimal of ``dt``."""
    plant: str | None = None
    """Name of the plant whose inputs a program sends; ``None``: no program may."""
    instances: int | None = None
    """N of a mesh of banks, whose messages hold the data of N targets; ``None``: it has no bank."""


def model_answer(configuration: Configuration, boot: str | None = None) -> ModelAnswer:
    """What every estimator of a mesh answers: the declared model, and when the mesh has started."""
    model, plant = configuration.base_model, configuration.plant
    return ModelAnswer(
        boot=boot,
        model=configuration.digest(),
        dt=configuration.mesh.dt,
        A=model.A.tolist(),
        B=None if model.B is None else model.B.tolist(),
        noise_map=None if model.noise_map is None else model.noise_map.tolist(),
        rho=model.rho.tolist(),
        states=list(model.states),
        units=list(model.units),
        sensors={
            name: SensorRows(
                C=[list(row) for row in sensor.C], r=list(sensor.r), outputs=list(sensor.outputs),
                D=[list(row) for row in sensor.D] or None, d=list(sensor.offset) or None,
                period=list(sensor.period) or None, source=sensor.source, time_error_ns=sensor.time_error_ns,
            )
            for name, sensor in configuration.sensors.items()
        },
        start_ns=configuration.mesh.start_ns,
        dt_exact=str(configuration.grid.dt),
        plant=plant.name if plant is not None and plant.is_external else None,
        offset=None if model.a is None else model.a.tolist(),
        continuous=None if configuration.continuous is None else _dynamics(configuration.continuous),
        instances=None if configuration.instances is None else configuration.instances.count,
        schedule=[LaterModel(first=one.first, model=_dynamics(one.model)) for one in configuration.schedule] or None,
    )  # fmt: skip


def _dynamics(model: LSUModel | ContinuousModel) -> Dynamics:
    parts = model.rates if isinstance(model, ContinuousModel) else model
    return Dynamics(
        A=parts.A.tolist(),
        B=None if parts.B is None else parts.B.tolist(),
        offset=None if parts.a is None else parts.a.tolist(),
        noise_map=None if parts.noise_map is None else parts.noise_map.tolist(),
        rho=parts.rho.tolist(),
    )


def encode_model(answer: ModelAnswer) -> bytes:
    """Its payload, a MessagePack map."""
    return msgspec.msgpack.encode(answer)
