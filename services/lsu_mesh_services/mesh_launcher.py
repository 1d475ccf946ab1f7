"""A whole mesh as processes of this machine: start, progress, a table, and the line that opens the recording."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from lsu_mesh.mesh.access import BANK_TOPICS
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import PREFIX, READER, key, parse
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.configuration import DEMO, flags, load_or_explain
from lsu_mesh_services.exit_codes import COULD_NOT_START, FAILURE, OK, USAGE
from lsu_mesh_services.mesh_start import moment_text
from lsu_mesh_services.monitoring.bank_report import BankReport
from lsu_mesh_services.monitoring.run_report import RunReport
from lsu_mesh_services.monitoring.table import Progress, print_json, print_table
from lsu_mesh_services.network.receive_queue import Arrival
from lsu_mesh_services.network.security import certificates, check_endpoints
from lsu_mesh_services.played_files import accounts_or_explain, last_step
from lsu_mesh_services.session import any_port, with_session
from lsu_mesh_services.stop import Stop
from lsu_mesh_services.supervisor import Supervisor
from lsu_mesh_services.viewers import Viewer, free_port

READY_S = 60.0
"""How long the peers may take to start; the first start on a machine compiles the kernels."""
LINKS_S = 10.0
"""How long to wait for the last connections when all peers are there."""
START_LEAD_S = 0.3
MAX_AT_ONCE = 1024
"""Messages that are processed before the children and the stop flag are checked again, however many more wait."""
START_ORDER = ("recorder", "plant", "sensor", "identifier", "fusion", "filter")
"""The recorder has most to load; before the first estimator is forked the kernels are loaded."""
BATCH_S = 0.05
"""So long more is waited for, once something has come: the table is made at the end, from the times of arrival."""
QUIET_S = 4.0
"""The run is over when the sources have ended and no new message has arrived for so long."""


class Player(Protocol):
    """Publishes recorded messages in the place of plant and sensors."""

    def announce(self, bus: Bus) -> None:
        """Declare the keys, so that subscribers know them before the first message."""

    def begin(self, now: int) -> None:
        """Let the recorded time begin."""

    def play(self, bus: Bus, report: RunReport, now: int, patience: float) -> float:
        """Publish what is due; returns for how long there is nothing to do, ``patience`` seconds at most."""

    @property
    def is_finished(self) -> bool:
        """Whether everything was published."""


@dataclass
class Run:
    """One run of a mesh under the supervisor."""

    configuration: Configuration
    options: argparse.Namespace
    supervisor: Supervisor
    bus: Bus
    clock: Clock
    stop: Stop
    report: RunReport
    recording: Path | None
    player: Player | None = None
    """Publishes what plant and sensors published in a recording, in their place."""
    last: int | None = None
    """The last step of the run; None: until stopped."""
    viewer: Viewer | None = None
    alive: set[str] = field(default_factory=set)
    seen: set[str] = field(default_factory=set)
    """Who was alive at some time."""
    happened: list[str] = field(default_factory=list)
    began: float = field(default_factory=time.monotonic)
    stopping: bool = False
    began_following: bool = False

    @property
    def external(self) -> set[str]:
        """Peers that somebody else starts."""
        return {name for role, name in self.configuration.peers() if self.configuration.is_external(role, name)}

    @property
    def came(self) -> set[str]:
        """Peers that were there, or have sent something."""
        return self.seen | self.report.used

    def record(self, words: str) -> None:
        """Remember what happened and when, for the table."""
        self.happened.append(f"{time.monotonic() - self.began:7.2f} s  {words}")

    def turn(self, timeout: float = 0.05) -> None:
        """Take what has come, publish what is due, and look after the children."""
        if self.player is not None:
            timeout = self.player.play(self.bus, self.report, self.clock.now(), timeout)
        for taken in range(MAX_AT_ONCE):
            arrival = self.bus.next(0 if taken else timeout)
            if arrival is None:
                break
            if not taken and self.player is None:
                time.sleep(BATCH_S)
            self._take(arrival)
        if self.viewer is not None and (words := self.viewer.end_words()):
            self.record(words)
        for child, words in self.supervisor.watch(time.monotonic()):
            self.record(words)
            if child.process is not None and child.process.poll() is not None and child.words:
                self.record(f"last words of {child.label}:\n{child.last_words()}")

    def _take(self, arrival: Arrival) -> None:
        if arrival.what == "sample":
            self.report.deliver(arrival.key, arrival.payload, arrival.arrival_ns)
            return
        address = parse(arrival.key)
        if address is None:
            return
        if arrival.what == "alive":
            if address.name not in self.alive and address.name in self.external and self.began_following:
                self.record(f"{address.name} has come")
            self.alive.add(address.name)
            self.seen.add(address.name)
        elif address.name in self.alive:
            self.alive.discard(address.name)
            if not self.stopping:
                self.record(f"{address.name} left the mesh")


def run_mesh(configuration: Configuration, options: argparse.Namespace, player: Player | None = None) -> int:
    """Run the mesh of a configuration, with a recording in the place of its sources where there is one."""
    played = accounts_or_explain(configuration)
    if played is None:
        return USAGE
    last = last_step(configuration, played)
    return with_session("run", lambda: _run_mesh(configuration, options, player, last))


def _run_mesh(
    configuration: Configuration, options: argparse.Namespace, player: Player | None, last: int | None
) -> int:
    stop: Stop = options.stop
    clock = Clock()
    if configuration.awaits_start:
        configuration = configuration.started(clock.now())  # whatever is measured from now on is of use
    settings = _session_settings(configuration, options)
    with Bus(settings, clock) as bus:
        recording = None if options.no_record else _recording_path(configuration, options)
        supervisor = Supervisor(configuration.supervisor, forks=True)
        report = RunReport(configuration) if configuration.instances is None else BankReport(configuration)
        run = Run(
            configuration=configuration,
            options=options,
            supervisor=supervisor,
            bus=bus,
            clock=clock,
            stop=stop,
            report=report,
            recording=recording,
            player=player,
            last=last,
        )
        return _supervise(run)


def _session_settings(configuration: Configuration, options: argparse.Namespace) -> SessionSettings:
    """The one listener that newcomers find; it reads and publishes nothing."""
    network = configuration.network
    listen = (network.entry, *network.listen)
    check_endpoints(listen, (), insecure=options.insecure)
    return SessionSettings(
        connect=network.connect,
        listen=listen,
        cache=configuration.cached,
        certificates=certificates(configuration, READER),
    )


def _recording_path(configuration: Configuration, options: argparse.Namespace) -> Path:
    template = options.record or configuration.recorder.path
    moment = time.strftime("%Y%m%d-%H%M%S")
    return Path(template.replace("{mesh}", configuration.mesh.name).replace("{time}", moment))


def _supervise(run: Run) -> int:
    is_bank = run.configuration.instances is not None
    for topic in ("truth", "posterior", "fused", "health", "event"):
        topic = BANK_TOPICS.get(topic, topic) if is_bank else topic
        run.bus.subscribe(f"{PREFIX}/{run.configuration.mesh.name}/{topic}/*")
    run.bus.watch_alive(key(run.configuration.mesh.name, "live", "*"))
    if run.player is not None:
        run.player.announce(run.bus)
    run.viewer = _viewer(run)
    try:
        _announce(run)
        code = _start(run)
        if code == OK:
            _follow(run)
    finally:
        run.stopping = True
        complaints = run.supervisor.stop()
        if run.viewer is not None:
            run.viewer.close()
        run.supervisor.kill()
    run.happened += complaints
    never = sorted(run.external - run.came)
    run.happened += [f"{name}, which is external, never came" for name in never]
    if code == USAGE and load_or_explain(run.options.file, run.options) is None:
        return USAGE
    if code != OK:
        for words in run.happened:
            print(words, file=sys.stderr)
        return OK if run.stop.is_set else code
    _settle(run)
    return _sum_up(run)


def _viewer(run: Run) -> Viewer | None:
    """The viewer that is asked for; it follows the recorder."""
    web_port: int | None = getattr(run.options, "web", None)
    is_wanted = web_port is not None or getattr(run.options, "view", False)
    return Viewer(free_port(), web_port is not None, web_port or 0) if is_wanted and run.recording else None


def _announce(run: Run) -> None:
    mesh = run.configuration.mesh
    last = run.last
    length = "until stopped" if last is None else f"{last} steps"
    where = "not recorded" if run.recording is None else f"recorded in {run.recording}"
    played = 0 if run.player is None else sum(role in ("plant", "sensor") for role, _ in run.configuration.peers())
    external = sorted(run.external)
    count = len(run.configuration.peers()) - (run.recording is None) - played - len(external)
    print(f"mesh {mesh.name!r}: {count} peers, {length} at {mesh.rate:g} Hz, {where}", file=sys.stderr)
    if mesh.is_live:
        print(
            f"t_0 of the mesh is {moment_text(run.configuration.grid.start_ns)}: its prior is of then", file=sys.stderr
        )
    for name in external:
        print(
            f"{name} is external: nobody waits for it; lsu-mesh publish {name} sends what it measures", file=sys.stderr
        )


def _start(run: Run) -> int:
    """Start everyone, wait until all see one another, then let the sources begin."""
    names = set()
    held = []
    for role, name in sorted(run.configuration.peers(), key=lambda peer: START_ORDER.index(peer[0])):
        if role == "recorder" and run.recording is None:
            continue
        is_source = not run.configuration.mesh.is_live and _is_source(run.configuration, role, name)
        if (run.player is not None and role in ("plant", "sensor")) or name in run.external:
            continue
        child = run.supervisor.start(role, name, _arguments(run, role), held=is_source)
        names.add(name)
        if is_source:
            held.append(child)
    code = _await_mesh(run, names)
    if code != OK:
        return code
    if run.viewer is not None:
        print(run.viewer.open(), file=sys.stderr)
    begin = run.clock.now() + int(START_LEAD_S * 1e9)
    if run.player is not None:
        run.player.begin(begin)
    for child in held:
        run.supervisor.tell(child, str(begin))
    run.began_following = True
    return OK


def _is_source(configuration: Configuration, role: str, name: str) -> bool:
    return role == "plant" or (role == "sensor" and configuration.sensors[name].file is not None)


def _arguments(run: Run, role: str) -> list[str]:
    """What a child is started with: the configuration of this run."""
    file = run.options.file if run.options.file is not None else str(DEMO)
    arguments = ["-c", file, "-e", run.configuration.network.entry, "-l", any_port(run.configuration)]
    last = run.last
    end = [] if last is None else [f"mesh.steps={last}"]
    for override in [*flags(run.options), *run.options.overrides, *end]:
        arguments += ["-X", override]
    if run.configuration.mesh.starts_now:
        arguments += ["-X", f'mesh.start_time="{run.configuration.values["mesh"]["start_time"]}"']
    if role in ("plant", "sensor") and not run.configuration.mesh.is_live:
        arguments += ["--start-at", "-"]
    if role == "recorder":
        arguments += ["--record", str(run.recording)]
        if run.viewer is not None:
            arguments += ["--serve", str(run.viewer.port)]
    return arguments


def _await_mesh(run: Run, names: set[str]) -> int:
    """Wait until every peer is there and connected to all others; else the exit code that says why not.

    Filters check their own options; a peer that refuses its configuration would refuse it again.
    """
    end, patience = time.monotonic() + READY_S, 0.0
    while True:
        run.turn()
        if run.stop:
            run.record("stopped before the mesh was up")
            return COULD_NOT_START
        if any(child.process is not None and child.process.returncode == USAGE for child in run.supervisor.children):
            return USAGE
        failed = [child for child in run.supervisor.children if child.given_up or child.restarts]
        if failed or time.monotonic() > end:
            run.record(f"the mesh did not come up; not there: {', '.join(sorted(names - run.alive))}")
            return COULD_NOT_START
        if names <= run.alive:
            if all(run.report.links.get(name, 0) >= len(names) for name in names):
                return OK
            patience = patience or time.monotonic() + LINKS_S
            if time.monotonic() > patience:
                run.record(f"not all peers are connected after {LINKS_S:g} s; going on: {run.report.links}")
                return OK


def _follow(run: Run) -> None:
    """Until the last step has been reached everywhere, the sources have ended, or someone says stop."""
    last = run.last
    newest, changed = 0, time.monotonic()
    with Progress(last, shown=not run.options.json) as progress:
        while not run.stop:
            run.turn()
            reached = run.report.progress()
            progress.show(reached)
            if reached > newest:
                newest, changed = reached, time.monotonic()
            if last is not None and run.report.last_step() >= last:
                return
            if time.monotonic() - changed > QUIET_S and _sources_ended(run, last):
                run.record(f"nothing new for {QUIET_S:g} s after the sources ended at step {last}")
                return


def _sources_ended(run: Run, last: int | None) -> bool:
    if run.player is not None:
        return run.player.is_finished
    steps = run.report.source_steps
    return last is not None and bool(steps) and max(steps.values()) >= last


def _settle(run: Run) -> None:
    """Take what was still under way."""
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        arrival = run.bus.next(0.05)
        if arrival is not None and arrival.what == "sample":
            run.report.deliver(arrival.key, arrival.payload, arrival.arrival_ns)


def _sum_up(run: Run) -> int:
    restarts = {child.name: child.restarts for child in run.supervisor.children}
    rows = run.report.rows(restarts)
    run.happened += run.report.duplicates.values()
    opening = _opening_line(run.recording)
    if run.options.json:
        print_json(rows, run.happened, run.report.events, run.recording)
    else:
        print_table(rows, run.happened, run.report.events, opening)
    gave_up = [child.label for child in run.supervisor.children if child.given_up]
    nothing = not any(row.steps for row in rows)
    if nothing:
        print("no estimate was published", file=sys.stderr)
    return FAILURE if gave_up or nothing else OK


def _opening_line(recording: Path | None) -> str:
    if recording is None:
        return ""
    module = [sys.executable, "-P", "-m", "lsu_mesh_services"]
    program: Sequence[str] = [sys.argv[0]] if sys.argv[0].endswith("lsu-mesh") else module
    return " ".join([_relative(program[0]), *program[1:], "view", str(recording)])


def _relative(program: str) -> str:
    path = Path(program)
    try:
        return str(path.absolute().relative_to(Path.cwd()))
    except ValueError:
        return program
