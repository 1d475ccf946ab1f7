"""A mesh of real processes that a test starts, breaks and watches from outside."""

from __future__ import annotations

import gc
import os
import shutil
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

import psutil
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.commands.keys import make_files
from lsu_mesh_services.network.certificate_authority import LOOPBACK_HOSTS
from lsu_mesh_services.network.security import certificates
from lsu_mesh_services.supervisor import Child, Supervisor
from ports import free_port
from tcp_proxy import Proxy

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.config.settings import SupervisorSettings
from lsu_mesh.mesh.keys import PREFIX, READER, key
from lsu_mesh.mesh.messages import TYPES, Event, Fused, Health, Message, Posterior, Truth
from lsu_mesh.mesh.nodes.plant import PlantNode
from lsu_mesh.mesh.nodes.schedule import Schedule

ROOT = Path(__file__).resolve().parent.parent
SPEAKS = {"plant": "truth", "sensor": "measurement", "filter": "posterior", "fusion": "fused"}
"""What shows that a peer of a role works; a recorder tells it in its health."""
SLACK_S = 0.4
"""An estimate of a step that was due so long ago still counts as one of the present, in seconds."""
READY_S = 120.0
"""A loaded machine compiles and loads slowly."""


@dataclass(frozen=True)
class Seen:
    """One estimate as it arrived."""

    arrival_ns: int
    message: Posterior


@dataclass
class Observer:
    """Everything that came to a subscriber of all, stamped when it came."""

    configuration: Configuration
    estimates: dict[str, list[Seen]] = field(default_factory=lambda: defaultdict(list))
    newest: dict[str, tuple[int, Message]] = field(default_factory=dict)
    """Arrival and message at each key."""
    health: dict[str, list[tuple[int, Health]]] = field(default_factory=lambda: defaultdict(list))
    tokens: list[tuple[int, str, bool]] = field(default_factory=list)
    """Arrival, name, whether the peer is there."""
    events: list[Event] = field(default_factory=list)
    alive: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.admission = Admission(self.configuration, TYPES)

    def take(self, what: str, address: str, payload: bytes, arrival_ns: int) -> None:
        """Note an arrival."""
        if what != "sample":
            name = address.rpartition("/")[2]
            self.tokens.append((arrival_ns, name, what == "alive"))
            (self.alive.add if what == "alive" else self.alive.discard)(name)
            return
        message = self.admission.admit(address, payload)
        if message is None:
            return
        self.newest[address] = (arrival_ns, message)
        if isinstance(message, Posterior):
            self.record(Seen(arrival_ns, message))
        elif isinstance(message, Health):
            self.health[message.name].append((arrival_ns, message))
        elif isinstance(message, Event):
            self.events.append(message)

    def record(self, seen: Seen) -> None:
        """Keep an estimate."""
        self.estimates[seen.message.name].append(seen)


class LiveMesh:
    """Peers of a configuration as processes, and an observer; a context manager.

    Parameters
    ----------
    folder:
        Where files of the run are written.
    overrides:
        As ``-X``.
    star:
        Each peer is a client of a router, over mutual TLS, through a proxy of its own. Else peers find one another.
    topics, observer:
        What is subscribed to, and who notes it.
    serve:
        Port at which the recorder serves viewers.
    """

    def __init__(
        self,
        folder: Path,
        overrides: Sequence[str] = (),
        *,
        star: bool = False,
        topics: Sequence[str] = tuple(TYPES),
        observer: type[Observer] = Observer,
        serve: int | None = None,
    ) -> None:
        self.star, self._topics, self._folder, self._serve = star, topics, folder, serve
        file = Path(shutil.copy(ROOT / "services" / "lsu_mesh_services" / "demo.toml", folder / "mesh.toml"))
        self._port = free_port()
        entry = f"{'tls' if star else 'tcp'}/127.0.0.1:{self._port}"
        secured = ["network.tls.enabled=true"] if star else []
        self._overrides = [*secured, f"network.entry={entry}", "mesh.steps=1000000", *overrides]
        self.configuration = load(file, self._overrides)
        if star:
            make_files(self.configuration, LOOPBACK_HOSTS, days=2)
        settings = SupervisorSettings(restart=True, backoff=0.0, limit=10**6)
        environment = {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "services")]), "CI": "true"}
        self.supervisor = Supervisor(settings, environment)
        self.clock = Clock()
        self.observer = observer(self.configuration)
        self.start_ns = 0
        self.peers = self.configuration.peers()
        self.proxies: dict[str, Proxy] = {}
        self._ending = threading.Event()
        self._reader = threading.Thread(target=self._observe, daemon=True)
        self._failure: Exception | None = None

    # -- begin and end

    def __enter__(self) -> Self:
        gc.disable()  # searching all that was seen takes ever longer, and what comes meanwhile is timed wrongly
        try:
            self._begin()
        except BaseException:
            self._end()
            gc.enable()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()
        gc.enable()

    def _begin(self) -> None:
        if self.star:
            arguments = ["-c", str(self.configuration.path), *self._settings()]
            self.supervisor.start("router", "router", arguments)
        self._bus = Bus(self._own_session(), self.clock)
        for topic in self._topics:
            self._bus.subscribe(f"{PREFIX}/{self.configuration.mesh.name}/{topic}/*")
        self._bus.watch_alive(key(self.configuration.mesh.name, "live", "*"))
        self._reader.start()
        for role, name in self.peers:
            self.supervisor.start(role, name, self._arguments(role, name), held=role == "plant")
        self.until(lambda: {name for _, name in self.peers} <= self.observer.alive, "all peers are there", READY_S)
        self.until(self._is_meshed, "all peers are connected", READY_S)
        self.start_ns = self.clock.now() + 300_000_000
        self.supervisor.tell(self.child("plant"), str(self.start_ns))

    def _is_meshed(self) -> bool:
        expected = 1 if self.star else len(self.peers)
        latest = {name: health[-1][1].counters.get("links", 0.0) for name, health in self.observer.health.items()}
        return all(latest.get(name, 0.0) >= expected for _, name in self.peers)

    def _own_session(self) -> SessionSettings:
        """Beside the mesh: it holds the entry, or is a client of the router."""
        entry = self.configuration.network.entry
        files = certificates(self.configuration, READER)
        size = self.configuration.cached
        if self.star:
            return SessionSettings((entry,), (), mode="client", cache=size, certificates=files)
        return SessionSettings((), (entry,), cache=size, certificates=files)

    def _settings(self) -> list[str]:
        return [word for override in self._overrides for word in ("-X", override)]

    def _arguments(self, role: str, name: str) -> list[str]:
        arguments = ["-c", str(self.configuration.path), *self._settings()]
        if role == "plant":
            arguments += ["--start-at", "-"]
        if role == "recorder":
            arguments += ["--record", str(self._folder / "run.rrd")]
            arguments += [] if self._serve is None else ["--serve", str(self._serve)]
        if not self.star:
            return [*arguments, "-e", self.configuration.network.entry]
        proxy = self.proxies[name] = Proxy(self._port).__enter__()
        return [*arguments, "-m", "client", "-e", f"tls/127.0.0.1:{proxy.port}"]

    def _observe(self) -> None:
        admission = self.observer.admission
        self._bus.recover(admission.is_cached, admission.kept_ns)
        try:
            while not self._ending.is_set():
                for loss in self._bus.arrivals.take_losses():
                    admission.expect(loss.key, loss.boot, loss.first, loss.last)
                arrival = self._bus.next(0.1)
                if arrival is not None:
                    self.observer.take(arrival.what, arrival.key, arrival.payload, arrival.arrival_ns)
        except Exception as error:  # told by the next wait of the test
            self._failure = error

    def _end(self) -> None:
        for proxy in self.proxies.values():
            proxy.heal()
        self.supervisor.kill()
        for child in self.supervisor.children:
            if child.reader is not None:
                child.reader.join(timeout=10)
            if child.process is not None and child.process.stdin is not None:
                child.process.stdin.close()
        self._ending.set()
        if self._reader.is_alive():
            self._reader.join()
        if hasattr(self, "_bus"):
            self._bus.close()
        for proxy in self.proxies.values():
            proxy.__exit__(None, None, None)

    # -- watch

    def child(self, name: str) -> Child:
        """The process of a peer."""
        return next(child for child in self.supervisor.children if child.name == name)

    def process(self, name: str) -> psutil.Process:
        """The running process of a peer."""
        process = self.child(name).process
        assert process is not None
        return psutil.Process(process.pid)

    def until(self, met: Callable[[], bool], what: str, timeout: float = 60.0) -> float:
        """Wait for a condition; returns how long that took."""
        began = time.monotonic()
        while not met():
            if self._failure is not None:
                raise self._failure
            if time.monotonic() - began > timeout:
                raise AssertionError(f"{what}: not within {timeout:g} s\n{self.words()}")
            time.sleep(0.005)
        return time.monotonic() - began

    def words(self) -> str:
        """The last words of all processes and what the peers last said of themselves."""
        said = [f"{child.label}:\n{child.last_words()}" for child in self.supervisor.children if child.words]
        for name, health in self.observer.health.items():
            said.append(f"{name}: {health[-1][1].level} {health[-1][1].reasons} {health[-1][1].counters}")
        return "\n".join(said)

    def due(self, at_ns: int | None = None) -> int:
        """The step that the plant is at."""
        return Schedule(self.start_ns, self.configuration.mesh.rate).due(self.clock.now() if at_ns is None else at_ns)

    def steps(self, seconds: float) -> int:
        """So many steps are in a time, at least 3."""
        return max(3, round(seconds * self.configuration.mesh.rate))

    def estimators(self) -> list[str]:
        """Filters and fusions."""
        return [name for role, name in self.peers if role in ("filter", "fusion")]

    def is_current(self, since_ns: int, slack: float = SLACK_S) -> bool:
        """Whether everyone has published, since a moment, an estimate of the present from all of its sources."""
        return all(self._has_current(name, since_ns, slack) for name in self.estimators())

    def _has_current(self, name: str, since_ns: int, slack: float) -> bool:
        seen = self.observer.estimates[name]
        for estimate in reversed(seen[-200:]):
            if estimate.arrival_ns <= since_ns:
                return False
            message = estimate.message
            is_sound = message.status in ("ok", "restarted") and not message.missing
            if is_sound and message.step >= self.due(estimate.arrival_ns) - self.steps(slack):
                return not isinstance(message, Fused) or not message.rejected
        return False

    def speaks(self, role: str, name: str, since_ns: int) -> bool:
        """Whether a peer has done what its role is since a moment."""
        mesh = self.configuration.mesh.name
        topic = SPEAKS.get(role, "health")
        arrival_ns, message = self.observer.newest.get(key(mesh, topic, name), (0, None))
        if arrival_ns <= since_ns or message is None:
            return False
        return topic == "health" or message.step >= self.due(arrival_ns) - self.steps(SLACK_S)

    def gaps(self) -> dict[str, float]:
        """Messages that are known to be missing now, by peer, with the observer's own; dropped ones are among them."""
        counted = {name: health[-1][1].counters.get("gaps", 0.0) for name, health in self.observer.health.items()}
        return counted | {"observer": float(self.observer.admission.gaps)}

    def containment(self, since_ns: int = 0) -> tuple[int, int]:
        """How many estimates hold the truth, and how many there are."""
        seen = [estimate.message for name in self.estimators() for estimate in self.observer.estimates[name]
                if estimate.arrival_ns > since_ns]  # fmt: skip
        truth = TrueStates(self.configuration)
        return sum(holds(message, truth[message.step]) for message in seen), len(seen)


class TrueStates:
    """The true states, computed here: also of steps whose plant was dead."""

    def __init__(self, configuration: Configuration) -> None:
        assert configuration.plant is not None
        self._schedule = Schedule(0, configuration.mesh.rate)
        self._node = PlantNode(configuration, configuration.plant.name, "0" * 16, self._schedule)
        self._known: list[Sequence[float]] = []

    def __getitem__(self, step: int) -> Sequence[float]:
        while len(self._known) < step:
            due = self._schedule.time_of(len(self._known) + 1)
            assert due is not None
            self._known += [message.x for message in self._node.advance(due + 1000) if isinstance(message, Truth)]
        return self._known[step - 1]


def holds(message: Posterior, x: Sequence[float]) -> bool:
    """Whether the bounds hold the state."""
    return all(low <= value <= high for low, value, high in zip(message.lower, x, message.upper, strict=True))
