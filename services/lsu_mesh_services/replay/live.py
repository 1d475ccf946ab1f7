"""``lsu-mesh replay FILE --live``: filters and fusions as peers over Zenoh, fed from a recording at its pace."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from msgspec import structs

from lsu_mesh.mesh.config import ConfigurationError, load
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import encode, encoding
from lsu_mesh.mesh.replay import SOURCES
from lsu_mesh_services.bus import Bus
from lsu_mesh_services.configuration import print_problems
from lsu_mesh_services.exit_codes import USAGE
from lsu_mesh_services.mesh_launcher import run_mesh
from lsu_mesh_services.monitoring.run_report import RunReport
from lsu_mesh_services.recording.export import write_playable
from lsu_mesh_services.recording.read import Received, Recording
from lsu_mesh_services.replay.compare import CannotReplay
from lsu_mesh_services.replay.recompute import configurations
from lsu_mesh_services.stop import Stop


def replay_live(recording: Recording, options: argparse.Namespace) -> int:
    """Run the mesh on recorded data in real time; the exit code."""
    try:
        replayed, _ = configurations(recording, options)
        with tempfile.TemporaryDirectory(prefix="replay-") as folder:
            write_playable(recording, Path(folder), replayed)
            file = Path(folder) / "mesh.toml"
            configuration = load(file, _network(options))
            options.file, options.stop, options.insecure = str(file), Stop(), False
            options.steps = options.rate = options.seed = None
            options.no_record = options.record is None
            options.overrides = _network(options)
            return run_mesh(configuration, options, Player(recording.received, replayed.mesh.name))
    except ConfigurationError as error:
        print_problems(error)
    except CannotReplay as error:
        print(error, file=sys.stderr)
    return USAGE


def _network(options: argparse.Namespace) -> list[str]:
    """The flags that say where the mesh of the replay listens; the recorded mesh's own endpoints are left alone."""
    return [change for change in options.overrides if change.startswith("network.")]


class Player:
    """Publishes the recorded truth, inputs and measurements when they came, counted from :meth:`begin`."""

    def __init__(self, received: Sequence[Received], mesh: str) -> None:
        self._messages = [one for one in received if isinstance(one.message, SOURCES)]
        self._mesh = mesh
        self._next = 0
        self._shift: int | None = None

    def announce(self, bus: Bus) -> None:
        """Declare the keys."""
        for address in sorted({self._key(one) for one in self._messages}):
            bus.announce(address)

    def begin(self, now: int) -> None:
        """The first message is due now."""
        self._shift = now - self._messages[0].arrival_ns if self._messages else 0

    @property
    def is_finished(self) -> bool:
        """Whether everything was published."""
        return self._next >= len(self._messages)

    def play(self, bus: Bus, report: RunReport, now: int, patience: float) -> float:
        """Publish what is due, with the time now as its sending time."""
        while self._shift is not None and not self.is_finished:
            one = self._messages[self._next]
            due = one.arrival_ns + self._shift
            if due > now:
                return min(patience, max(0.0005, (due - now) * 1e-9))
            message = structs.replace(one.message, sent_ns=now, origin_ns=now)
            payload = encode(message)
            bus.publish(self._key(one), payload, encoding(message.topic))
            report.deliver(self._key(one), payload, now)  # a session does not hear itself
            self._next += 1
        return patience

    def _key(self, one: Received) -> str:
        return key(self._mesh, one.message.topic, one.message.name)
