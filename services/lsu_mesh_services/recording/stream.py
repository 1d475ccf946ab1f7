"""Opening the recording stream: file, batching, properties of the run."""

from __future__ import annotations

import errno
import hashlib
import importlib.metadata
import json
import os
import platform
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rerun as rr

from lsu_mesh.filters.registry import filter_class
from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.estimation.adoption import filter_algorithm
from lsu_mesh.mesh.estimation.fusion_step import fusion_algorithm
from lsu_mesh_services.recording.blueprint import blueprint
from lsu_mesh_services.recording.container import ARROW, RECORDING, Frame, frames, protobuf, store_of
from lsu_mesh_services.recording.entity_paths import EntityPaths
from lsu_mesh_services.recording.raw import description_checksum

MAX_INDEXED_S = 300.0
"""Runs that are longer have no index of their chunks at the end of the file: until then it would grow in memory."""
PACKAGES = ("lsu-mesh", "eclipse-zenoh", "msgspec", "numpy", "scipy", "numba", "rerun-sdk")


def open_file(names: EntityPaths, path: Path, described: Mapping[str, str], identifier: str) -> rr.RecordingStream:
    """A stream into a new file; ``described`` tells of the run.

    Raises ``OSError`` where the file exists or cannot be made; a folder that is missing is made.
    """
    _claim(path)
    stream = _new_stream(names, identifier)
    sink = rr.FileSink(path, write_footer=_is_short(names.configuration))
    stream.set_sinks(sink, default_blueprint=blueprint(names))
    stream.send_recording_name(f"{names.configuration.mesh.name} {path.stem}")
    send_description(stream, described)
    return stream


def open_server(names: EntityPaths, identifier: str, port: int) -> rr.RecordingStream:
    """A stream to viewers, who come to ``port`` of the loopback."""
    stream = _new_stream(names, identifier)
    sink = rr.GrpcServerSink(bind_ip="127.0.0.1", port=port, server_memory_limit="256MB")
    stream.set_sinks(sink, default_blueprint=blueprint(names))
    stream.send_recording_name(names.configuration.mesh.name)
    return stream


def new_identifier(configuration: Configuration) -> str:
    """The name of a new recording, by which its parts belong together."""
    return f"{configuration.mesh.name}-{os.urandom(8).hex()}"


def _new_stream(names: EntityPaths, identifier: str) -> rr.RecordingStream:
    rr.set_strict_mode(True)  # an error is an exception, which the recorder counts; else data vanish with a warning
    configuration = names.configuration
    return rr.RecordingStream(
        application_id(configuration),
        recording_id=identifier,
        batcher_config=rr.ChunkBatcherConfig(flush_tick=configuration.recorder.flush),
    )


def send_description(stream: rr.RecordingStream, described: Mapping[str, str]) -> None:
    """Write what a reader needs to compute the run again, with a checksum."""
    properties: dict[str, Any] = {**described, "checksum": description_checksum(described)}
    stream.send_property("lsu_mesh", rr.AnyValues(**properties))


def _is_short(configuration: Configuration) -> bool:
    steps, rate = configuration.mesh.steps, configuration.mesh.rate or 1.0 / configuration.mesh.dt
    return steps is not None and steps <= MAX_INDEXED_S * rate


def recording_id(path: Path) -> str | None:
    """Identifier of the recording in a file, also in one cut short or damaged; ``None`` where there is none."""
    try:
        for frame in frames(path):
            if isinstance(frame, Frame) and frame.kind == ARROW:
                found = {number: value for number, _, value in protobuf(store_of(frame))}
                if found.get(1) == RECORDING and isinstance(name := found.get(2), bytes):
                    return name.decode()
    except (OSError, ValueError):
        return None
    return None


def application_id(configuration: Configuration) -> str:
    """Name under which the viewer remembers a layout; no other mesh or version may open in the layout of this one."""
    peers = [configuration.peers(), configuration.base_model.states, _version("lsu-mesh")]
    kinds = [(one.kind, one.sensors, one.transfer) for one in configuration.filters.values()]
    digest = hashlib.blake2b(json.dumps([peers, kinds]).encode(), digest_size=4).hexdigest()
    return f"lsu-mesh {configuration.mesh.name} {digest}"


def run_description(configuration: Configuration) -> dict[str, str]:
    """What a reader needs to compute a recording again: configuration, model, seed, versions, processor."""
    model = configuration.base_model
    matrices = {
        "A": model.A.tolist(),
        "B": None if model.B is None else model.B.tolist(),
        "noise_map": None if model.noise_map is None else model.noise_map.tolist(),
        "rho": model.rho.tolist(),
        "sensors": {name: {"C": sensor.C, "r": sensor.r} for name, sensor in configuration.sensors.items()},
    }
    return {
        "configuration": _text(configuration.path),
        "configuration_path": str(configuration.path),
        "settings": json.dumps(configuration.values),
        "mesh": configuration.mesh.name,
        "model": json.dumps(matrices),
        "algorithms": json.dumps(algorithms(configuration)),
        "model_digest": configuration.digest(),
        "seed": str(configuration.mesh.seed),
        "dt": repr(configuration.mesh.dt),
        "python": platform.python_version(),
        "cpu": processor(),
        "platform": f"{sys.platform} {platform.machine()}",
        "numba_cpu_name": os.environ.get("NUMBA_CPU_NAME", ""),
    } | {package.replace("-", "_"): _version(package) for package in PACKAGES}


def algorithms(configuration: Configuration) -> dict[str, int]:
    """Numbers of the arithmetic of the kinds of filters, the highest of each, and policies of a mesh.

    Sets of another number have other bits.
    """
    numbers: dict[str, int] = {}
    for one in sorted(configuration.filters.values(), key=lambda one: one.kind):
        number = filter_algorithm(one, filter_class(one.kind))
        numbers[one.kind] = max(number, numbers.get(one.kind, number))
    policies = {one.policy for one in configuration.fusion.values()}
    return numbers | {policy: fusion_algorithm(POLICIES[policy]) for policy in sorted(policies)}


def _claim(path: Path) -> None:
    """Make sure that the file is new and can be written; Rerun itself would overwrite it or fail in silence."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with path.open("xb"):
            pass
    except FileExistsError:
        text = "the file exists already and would be overwritten"
        raise FileExistsError(errno.EEXIST, text, str(path)) from None


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        return f"not readable when the recording began: {error}"


def processor() -> str:
    """Name of the processor for which the kernels are compiled."""
    from llvmlite import binding  # numba's own name of the target, which decides what its kernels are compiled to

    return str(binding.get_host_cpu_name())
