"""``lsu-mesh health``: the level of each peer of a running mesh, as one more subscriber receives it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import PREFIX, key, parse
from lsu_mesh.mesh.messages import Health
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.observer import HealthObserver, PeerHealth, worst
from lsu_mesh_services.bus import Bus, Clock
from lsu_mesh_services.configuration import load_or_explain
from lsu_mesh_services.exit_codes import NOT_MET, OK, USAGE
from lsu_mesh_services.mesh_start import find_start
from lsu_mesh_services.network.receive_queue import Arrival
from lsu_mesh_services.session import connection_report, session_settings, with_session

SHOWN = ("received", "gaps", "duplicates", "dropped", "late", "rewinds", "contradictions", "behind", "queue", "step_ms")
"""Counters with a column of their own; refusals are summed, and listed by reason below the table."""
TITLES = {"contradictions": "contra", "step_ms": "step ms"}


def main(options: argparse.Namespace) -> int:
    configuration = load_or_explain(options.config, options, makes_filters=False)
    if configuration is None:
        return USAGE
    return with_session("health", lambda: _tell(configuration, options))


def _tell(configuration: Configuration, options: argparse.Namespace) -> int:
    peers = _listen(configuration, options)
    print_json(peers) if options.json else print_table(peers)
    return OK if worst([peer.level for peer in peers]) == "OK" else NOT_MET


def _listen(configuration: Configuration, options: argparse.Namespace) -> list[PeerHealth]:
    """Heartbeats and liveliness of so many seconds, judged at their end."""
    clock, mesh = Clock(), configuration.mesh.name
    observer = HealthObserver(configuration, clock.now())
    settings = session_settings(configuration, options)
    with Bus(settings, clock) as bus, connection_report("health", bus, settings, says_connected=False):
        configuration = find_start(configuration, bus, clock, options.seconds) or configuration.started(0)
        admission = Admission(configuration, ("health",))
        bus.subscribe(f"{PREFIX}/{mesh}/health/*")
        bus.watch_alive(key(mesh, "live", "*"))
        end = clock.now() + int(options.seconds * SECOND)
        while (left := end - clock.now()) > 0:
            arrival = bus.next(left / SECOND)
            if arrival is not None:
                record(observer, admission, arrival)
        return observer.peers(clock.now())


def record(observer: HealthObserver, admission: Admission, arrival: Arrival) -> None:
    """Tell the observer what has come."""
    if arrival.what != "sample":
        address = parse(arrival.key)
        if address is not None:
            observer.record_presence(address.name, arrival.what == "alive")
        return
    message = admission.admit(arrival.key, arrival.payload)
    if isinstance(message, Health):
        observer.record(message, arrival.arrival_ns)


def print_json(peers: Sequence[PeerHealth]) -> None:
    """One line per peer."""
    for peer in peers:
        about = {"name": peer.name, "role": peer.role, "level": peer.level, "reasons": list(peer.reasons)}
        age = None if peer.age_ns is None else peer.age_ns / SECOND
        more: dict[str, object] = {"counters": dict(peer.counters), "started_ns": peer.started_ns, "host": peer.host}
        more["processes"] = [asdict(process) for process in peer.processes]
        print(json.dumps(about | {"step": peer.step, "age_s": age} | more))


def _shown(name: str, count: float | None) -> str:
    if count is None:
        return "–"
    return f"{count:.1f}" if name.endswith("_ms") else f"{count:.0f}"


def refusals(peer: PeerHealth) -> dict[str, float]:
    """How many messages the peer has refused, by reason."""
    counters = peer.counters.items()
    return {name.removeprefix("refused."): count for name, count in counters if name.startswith("refused.")}


def unknown_fields(peer: PeerHealth) -> dict[str, float]:
    """How many fields the peer has ignored, by topic and name."""
    prefix = "unknown fields."
    return {name.removeprefix(prefix): count for name, count in peer.counters.items() if name.startswith(prefix)}


def print_table(peers: Sequence[PeerHealth]) -> None:
    """One row per peer, its reasons below."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 140, highlight=False)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("", "role", "level"):
        table.add_column(title)
    for title in ("step", *(TITLES.get(name, name) for name in SHOWN), "refused"):
        table.add_column(title, justify="right")
    for peer in peers:
        counts = [_shown(name, peer.counters.get(name)) for name in SHOWN]
        table.add_row(peer.name, peer.role, peer.level, str(peer.step), *counts, f"{sum(refusals(peer).values()):g}")
    console.print(table)
    for peer in peers:
        if refused := refusals(peer):
            by_reason = ", ".join(f"{count:g} by {reason}" for reason, count in refused.items())
            console.print(f"{peer.role}/{peer.name} has refused {by_reason}", markup=False, soft_wrap=True)
        if ignored := unknown_fields(peer):
            names = ", ".join(f"{name} {count:g} times" for name, count in ignored.items())
            text = f"{peer.role}/{peer.name} ignores fields of a newer peer: {names}"
            console.print(text, markup=False, soft_wrap=True)
        for reason in peer.reasons:
            console.print(f"{peer.level} {peer.role}/{peer.name}: {reason}", markup=False, soft_wrap=True)
    console.print(f"the mesh: {worst([peer.level for peer in peers])}")
