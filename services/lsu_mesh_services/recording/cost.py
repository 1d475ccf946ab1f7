"""What recording costs: processor time per message and bytes per step, batched and logged one by one.

The messages of a made-up mesh go to the recorder as fast as it takes them. Beside it, in the same run: the same
entities logged one by one as the messages come, sets as often as the recorder draws them.
"""

from __future__ import annotations

import gc
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Measurement, Posterior, Prediction, Truth
from lsu_mesh_services.recording.entity_paths import EntityPaths, path
from lsu_mesh_services.recording.read import read_raw
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.recording.set_geometry import body, project
from lsu_mesh_services.recording.synthetic_mesh import START_NS, Arrival, SyntheticMesh, written

NAIVE_STEPS = 60


@dataclass(frozen=True)
class Cost:
    """Costs of one recording; processor time is that of all threads."""

    filters: int
    rate: float
    messages: int
    microseconds_per_message: float
    share_of_one_core: float
    """Processor time per second of the run."""
    bytes_per_step: int
    naive_microseconds_per_message: float
    naive_over_batched: float
    lost: int
    """Messages that are not in the file, bit by bit."""
    problems: list[str]


def measure(filters: int = 12, states: int = 3, rate: float = 200.0, steps: int = 600) -> Cost:
    """Record ``steps`` steps of a mesh of so many filters at ``rate`` steps per second."""
    with tempfile.TemporaryDirectory() as folder:
        configuration = written(Path(folder), states, filters, 1.0 / rate)
        arrivals = paced(SyntheticMesh(configuration), steps, rate)
        gc.collect()
        gc.freeze()  # the prepared messages are no garbage of the recorder
        target = Path(folder) / "batched.rrd"
        batched, size, problems = batch_cost(configuration, arrivals, target)
        gc.unfreeze()
        stored = [(message.key, message.payload) for message in read_raw(target)]
        lost = sum(one != (a.key, a.payload) for one, a in zip(stored, arrivals, strict=False))
        lost += abs(len(arrivals) - len(stored))
        few = [arrival for arrival in arrivals if arrival.message.step <= NAIVE_STEPS]
        naive = naive_cost(configuration, few, Path(folder) / "naive.rrd")
    return Cost(
        filters=filters,
        rate=rate,
        messages=len(arrivals),
        microseconds_per_message=round(batched * 1e6, 1),
        share_of_one_core=round(batched * len(arrivals) / steps * rate, 3),
        bytes_per_step=round(size / steps),
        naive_microseconds_per_message=round(naive * 1e6, 1),
        naive_over_batched=round(naive / batched, 1),
        lost=lost,
        problems=problems,
    )


def paced(mesh: SyntheticMesh, steps: int, rate: float) -> list[Arrival]:
    """The messages of a run with the arrivals that they have at this rate."""
    return [
        arrival._replace(arrival_ns=START_NS + int(k / rate * 1e9) + 1000 * i)
        for k in range(1, steps + 1)
        for i, arrival in enumerate(mesh.step(k))
    ]


def batch_cost(configuration: Configuration, arrivals: Sequence[Arrival], target: Path) -> tuple[float, int, list[str]]:
    """Processor seconds per message of the recorder, bytes of its file, problems."""
    recorder = Recorder(configuration, target)
    began = time.process_time()
    for arrival in arrivals:
        recorder.record(*arrival)
        recorder.tick(arrival.arrival_ns)
    recorder.close()
    return (time.process_time() - began) / len(arrivals), target.stat().st_size, recorder.problems


def naive_cost(configuration: Configuration, arrivals: Sequence[Arrival], target: Path) -> float:
    """Processor seconds per message where everything is logged when it comes."""
    naive = Naive(configuration, target)
    began = time.process_time()
    for arrival in arrivals:
        naive.record(arrival)
    naive.stream.flush()
    naive.stream.disconnect()
    return (time.process_time() - began) / len(arrivals)


class Naive:
    """A recorder without batches."""

    def __init__(self, configuration: Configuration, target: Path) -> None:
        self.stream = rr.RecordingStream("naive")
        self.stream.set_sinks(rr.FileSink(target))
        self._names = EntityPaths(configuration)
        self._axes = self._names.axes()
        self._every = round(1.0 / configuration.mesh.dt / configuration.recorder.mesh_hz)
        self._truth = np.zeros(len(self._names.states))

    def record(self, arrival: Arrival) -> None:
        """Log a message, raw and drawn."""
        address, payload, arrival_ns, message = arrival
        self.stream.set_time("step", sequence=message.step)
        self.stream.set_time("sim_time", duration=message.step * self._names.configuration.mesh.dt)
        self.stream.set_time("wall_time", timestamp=np.datetime64(arrival_ns, "ns"))
        raw = rr.AnyValues(payload=payload, key=address, arrival_ns=arrival_ns, number=0)
        self.stream.log(path("raw", message.topic, message.name), raw)
        if isinstance(message, Truth):
            self._truth = np.array(message.x)
            for state, value in zip(self._names.states, message.x, strict=True):
                self.stream.log(path("truth", state), rr.Measurements(value))
        elif isinstance(message, Measurement):
            for output, y in zip(self._names.outputs, message.y, strict=False):
                self.stream.log(output.measured(), rr.Scalars(y or 0.0))
        elif isinstance(message, Prediction):
            for i, output in enumerate(self._names.outputs_of_filter(message.name)):
                values = np.array([message.y_lower[i], message.y_point[i], message.y_upper[i]])
                self._band(output.predicted(message.name), values)
        elif isinstance(message, Posterior):
            self._posterior(message, arrival_ns)

    def _posterior(self, message: Posterior, arrival_ns: int) -> None:
        for i, state in enumerate(self._names.states):
            values = np.array([message.lower[i], message.point[i], message.upper[i]])
            self._band(path("bands", state, message.name), values)
            self._band(path("errors", state, message.name), values - self._truth[i])
        self.stream.log(path("widths", message.name), rr.Scalars(np.subtract(message.upper, message.lower)))
        self.stream.log(path("log_volume", message.name), rr.Scalars(message.log_volume or 0.0))
        self.stream.log(path("latency", message.name), rr.Scalars((arrival_ns - message.origin_ns) / 1e6))
        if message.step % self._every == 1:
            drawn = body(project(message.support, self._axes))
            corners, normals = drawn.triangles.reshape(-1, 3), np.repeat(drawn.normals, 3, axis=0)
            entity = path("space", "sets", message.name)
            self.stream.log(entity, rr.Mesh3D(vertex_positions=corners, vertex_normals=normals))
            self.stream.log(f"{entity}/edges", rr.LineStrips3D(list(drawn.edges)))

    def _band(self, entity: str, values: NDArray[np.float64]) -> None:
        half = 0.5 * (values[2] - values[0])
        series = [values[0] + half, *values]
        self.stream.log(entity, rr.Measurements(series, variances=[half * half, 0.0, 0.0, 0.0]))
