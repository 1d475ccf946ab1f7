"""The digest of a mesh: peers of other mathematics refuse one another, peers of other bounds do not."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from lsu_mesh.array_types import Matrix
from lsu_mesh.model import ContinuousModel, LSUModel

if TYPE_CHECKING:
    from lsu_mesh.mesh.config.settings import Configuration, SensorSettings

Rows = Sequence[Sequence[float]]


def digest(configuration: Configuration) -> str:
    """16 hexadecimal characters over the mathematics of a mesh, as ``docs/protocol.md`` lists it.

    First A, B, N and the rows of C, then each further part under its name, if it is given and not 0.
    """
    state = hashlib.blake2b(digest_size=8)
    first = configuration.base_model if configuration.continuous is None else configuration.continuous.rates
    for matrix in (first.A, first.B, first.noise_map):
        state.update(_matrix(matrix))
    for name in sorted(configuration.sensors):
        state.update(name.encode())
        state.update(_matrix(np.array(configuration.sensors[name].C, dtype=np.float64)))
    for part, content in _further(configuration, first):
        state.update(struct.pack("<2q", len(part), len(content)) + part.encode() + content)
    return state.hexdigest()


def _further(configuration: Configuration, first: LSUModel) -> Iterator[tuple[str, bytes]]:
    """The parts that a discrete model need not have."""
    if configuration.continuous is not None:
        yield "continuous", b""
    if first.a is not None:
        yield "offset", _matrix(first.a.reshape(1, -1))
    for entry in configuration.schedule:
        model = entry.model.rates if isinstance(entry.model, ContinuousModel) else entry.model
        offset = None if model.a is None else model.a.reshape(1, -1)
        parts = (model.A, model.B, model.noise_map, offset)
        yield f"schedule {entry.first}", b"".join(map(_matrix, parts))
    for name in sorted(configuration.sensors):
        for part, rows in _of_sensor(configuration.sensors[name]):
            yield f"{part} {name}", _matrix(np.array(rows, dtype=np.float64))
    if configuration.instances is not None:
        yield "instances", struct.pack("<q", configuration.instances.count)
        if configuration.instances.A is not None:
            yield "instances A", (configuration.instances.A + 0.0).astype("<f8").tobytes()
    if depends_on_time(configuration):
        grid = configuration.grid
        yield "dt", f"{grid.dt.numerator}/{grid.dt.denominator}".encode()
        yield "start", str(grid.start_ns).encode()


def _of_sensor(sensor: SensorSettings) -> Iterator[tuple[str, Rows]]:
    if sensor.D:
        yield "D", sensor.D
    for part, values in (("d", sensor.offset), ("period", sensor.period), ("rate", sensor.rate)):
        if values:
            yield part, [values]
    if sensor.off_grid != "refuse":
        yield f"off_grid {sensor.off_grid}", []


def depends_on_time(configuration: Configuration) -> bool:
    """Whether dt and the start are part of the mathematics, so that peers of another grid are other peers.

    They are where the model is continuous, where it changes at a step, where a sensor's data may lie off the grid, and
    where sources are live, whose data have times and no steps.
    Else a model is of steps, whatever their length.
    """
    sensors = configuration.sensors.values()
    is_off_grid = any(sensor.rate or sensor.off_grid != "refuse" for sensor in sensors)
    return (
        configuration.mesh.is_live
        or configuration.continuous is not None
        or bool(configuration.schedule)
        or is_off_grid
    )


def _matrix(matrix: Matrix | None) -> bytes:
    shape: Sequence[int] = (0, 0) if matrix is None else (*matrix.shape, 0)[:2]
    content = b"" if matrix is None else (matrix + 0.0).astype("<f8").tobytes()
    return struct.pack("<2q", *shape) + content
