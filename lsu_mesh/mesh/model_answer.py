"""The answer to the ``model`` query: what a client must know of a mesh to read its sets."""

from __future__ import annotations

import msgspec
from msgspec import Struct

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import VERSION


class SensorRows(Struct, frozen=True, kw_only=True):
    """One sensor: ``y = C x + v``, ``|v| ≤ r``."""

    C: list[list[float]]
    r: list[float]
    outputs: list[str]


class ModelAnswer(Struct, frozen=True, kw_only=True):
    """``x_(k+1) = A x_k + B u_k + noise_map w_k``, ``|w_k| ≤ rho``, with the names of all its parts."""

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
    """Kept for the time of step 0; not told yet."""
    boot: str | None = None
    """Kept for the boot of the answering process; not told yet."""


def model_answer(configuration: Configuration) -> ModelAnswer:
    """What every estimator of a mesh answers: the declared model."""
    model = configuration.base_model
    return ModelAnswer(
        model=configuration.digest(),
        dt=configuration.mesh.dt,
        A=model.A.tolist(),
        B=None if model.B is None else model.B.tolist(),
        noise_map=None if model.noise_map is None else model.noise_map.tolist(),
        rho=model.rho.tolist(),
        states=list(model.states),
        units=list(model.units),
        sensors={
            name: SensorRows(C=[list(row) for row in sensor.C], r=list(sensor.r), outputs=list(sensor.outputs))
            for name, sensor in configuration.sensors.items()
        },
    )


def encode_model(answer: ModelAnswer) -> bytes:
    """Its payload, a MessagePack map."""
    return msgspec.msgpack.encode(answer)
