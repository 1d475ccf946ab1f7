"""What recording costs: ``python benchmarks/recording.py [--filters 12] [--states 3] [--rate 200] [--steps 600]``.

Feeds the messages of a made-up mesh to the recorder as fast as it takes them and prints the processor time per message
(all threads), the share of one core at the given rate, and the bytes per step. Beside it, in the same run: the same
entities logged one by one as the messages come, sets as often as the recorder draws them.
"""

from __future__ import annotations

import argparse
import gc
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import numpy as np
import rerun as rr
from made_up_mesh import START_NS, Arrival, MadeUpMesh, written
from numpy.typing import NDArray

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Measurement, Posterior, Prediction, Truth
from services.recording.body import body, project
from services.recording.names import Names, path
from services.recording.recorder import Recorder

NAIVE_STEPS = 60


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; exit code 1 if the recorder could not keep up or lost something."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--filters", type=int, default=12)
    parser.add_argument("--states", type=int, default=3)
    parser.add_argument("--rate", type=float, default=200.0, help="steps per second")
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        configuration = written(Path(folder), options.states, options.filters, 1.0 / options.rate)
        arrivals = paced(MadeUpMesh(configuration), options.steps, options.rate)
        gc.collect()
        gc.freeze()  # the prepared messages are no garbage of the recorder
        batched, size, problems = batch_cost(configuration, arrivals, Path(folder) / "batched.rrd")
        few = [arrival for arrival in arrivals if arrival.message.step <= NAIVE_STEPS]
        naive = naive_cost(configuration, few, Path(folder) / "naive.rrd")
    per_step = len(arrivals) / options.steps
    result = {
        "messages": len(arrivals),
        "microseconds_per_message": round(batched * 1e6, 1),
        "share_of_one_core": round(batched * per_step * options.rate, 3),
        "bytes_per_step": round(size / options.steps),
        "naive_microseconds_per_message": round(naive * 1e6, 1),
        "naive_over_batched": round(naive / batched, 1),
        "problems": problems,
    }
    print(json.dumps(result) if options.json else "\n".join(f"{key:32} {value}" for key, value in result.items()))
    return 1 if problems or result["share_of_one_core"] >= 1 else 0


def paced(mesh: MadeUpMesh, steps: int, rate: float) -> list[Arrival]:
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
        self._names = Names(configuration)
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
            self.stream.log(f"{entity}/edges", rr.LineStrips3D(drawn.edges))

    def _band(self, entity: str, values: NDArray[np.float64]) -> None:
        half = 0.5 * (values[2] - values[0])
        series = [values[0] + half, *values]
        self.stream.log(entity, rr.Measurements(series, variances=[half * half, 0.0, 0.0, 0.0]))


if __name__ == "__main__":
    sys.exit(main())
