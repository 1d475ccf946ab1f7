"""The two sides of a comparison: the real mesh and the relay, each as processes that publish fused sets."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Protocol

import msgspec

from lsu_mesh.experiments.mesh_speed.benchmark_mesh import FUSION, NAME, mesh_values
from lsu_mesh.experiments.mesh_speed.local_steps import message_sizes
from lsu_mesh.experiments.mesh_speed.mesh_case import MeshCase
from lsu_mesh.mesh.config import Configuration, load_values
from lsu_mesh.mesh.config.write import to_toml
from lsu_mesh.mesh.keys import key
from lsu_mesh_services.benchmarks.process_group import ProcessGroup
from lsu_mesh_services.benchmarks.relay_plan import relay_plan
from lsu_mesh_services.benchmarks.relay_process import step_of

FUSED = key(NAME, "fused", FUSION)
LIVE = key(NAME, "live", "*")
HEALTH = key(NAME, "health", "*")


class FusedStep(NamedTuple):
    """What the subscriber looks at in a fused set."""

    step: int
    is_complete: bool
    """Whether every source went into it."""


class Side(Protocol):
    """Processes of a mesh, or of what stands in its place."""

    names: frozenset[str]
    """Whose liveliness tokens are awaited."""
    tells_links: bool
    """Whether they tell in their health to how many others they are linked."""
    clock: str
    """Label of the process that waits for the time of step 1 on its standard input."""

    def start(self, group: ProcessGroup, entry: str, folder: Path) -> None:
        """Start all processes; they meet at the endpoint, and write into the folder."""

    def read(self, payload: bytes) -> FusedStep:
        """A fused set as it arrived."""


class _FusedFields(msgspec.Struct):
    """Two fields of a fused set of any release."""

    step: int
    missing: list[str] = []


class RealMesh:
    """Every peer of the benchmark mesh as ``lsu-mesh ROLE NAME``."""

    tells_links = True
    clock = "plant plant"

    def __init__(self, case: MeshCase, overrides: tuple[str, ...] = ()) -> None:
        self._case, self._overrides = case, overrides
        configuration = case_configuration(case)
        self.peers = [peer for peer in configuration.peers() if case.recorder or peer[0] != "recorder"]
        self.names = frozenset(name for _, name in self.peers)
        self._decoder = msgspec.msgpack.Decoder(_FusedFields)

    def start(self, group: ProcessGroup, entry: str, folder: Path) -> None:
        file = folder / "bench.toml"
        file.write_text(to_toml(mesh_values(self._case.rate, self._case.filters, entry=entry)), encoding="utf-8")
        for role, name in self.peers:
            arguments = ["-m", "lsu_mesh_services", role, name, "-c", str(file), "-e", entry, "-l", "tcp/127.0.0.1:0"]
            for override in self._overrides:
                arguments += ["-X", override]
            arguments += ["--start-at", "-"] if role == "plant" else []
            arguments += ["--record", str(folder / "bench.rrd")] if role == "recorder" else []
            group.start(f"{role} {name}", arguments, held=role == "plant")

    def read(self, payload: bytes) -> FusedStep:
        found = self._decoder.decode(payload)
        return FusedStep(found.step, not found.missing)


class Relay:
    """As many processes, with the same keys, readers and sizes of messages, that only pass steps on."""

    tells_links = False
    clock = "plant plant"

    def __init__(self, case: MeshCase) -> None:
        configuration = case_configuration(case)
        self._parts = relay_plan(configuration, message_sizes(configuration), recorder=case.recorder)
        self.names = frozenset(part.alive.rpartition("/")[2] for part in self._parts)

    def start(self, group: ProcessGroup, entry: str, folder: Path) -> None:
        for part in self._parts:
            module = "lsu_mesh_services.benchmarks.relay_process"
            group.start(part.label, ["-m", module, part.text(), entry], held=part.rate > 0)

    def read(self, payload: bytes) -> FusedStep:
        return FusedStep(step_of(payload), True)


def case_configuration(case: MeshCase) -> Configuration:
    """The configuration of a case, without a network."""
    return load_values(mesh_values(case.rate, case.filters), Path("bench.toml"))
