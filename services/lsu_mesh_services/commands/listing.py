"""``lsu-mesh list``: peers that are there, and keys that are alive with their rates."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.flows import Flow, flows
from lsu_mesh.mesh.messages import Health
from lsu_mesh.mesh.processes import Process, Processes, words_of
from lsu_mesh_services.exit_codes import OK
from lsu_mesh_services.monitoring.stream_statistics import StreamStatistics
from lsu_mesh_services.monitoring.subscriber import run_tool, watching


def main(options: argparse.Namespace) -> int:
    return run_tool(options, _list)


def _list(configuration: Configuration, options: argparse.Namespace) -> int:
    published = flows(configuration)
    beats = {flow.address: StreamStatistics() for flow in published}
    there: set[str] = set()
    processes = Processes()
    with watching(configuration, options) as watch:
        watch.listen([(flow.topic, flow.name) for flow in published])
        for heard in watch.received(options.seconds):
            if heard is None:
                continue
            if heard.message is None:
                (there.add if heard.is_there else there.discard)(heard.name)
            else:
                beat = beats[f"{heard.topic}/{heard.name}"]
                beat.record(heard.arrival_ns, heard.message.sent_ns, heard.size, heard.message.step)
                if isinstance(heard.message, Health):
                    processes.record(heard.message, heard.arrival_ns)
        now = watch.clock.now()
        watch.tell_refused()
    roles = {name: role for role, name in configuration.peers()}
    running = {name: processes.of(name, now) for name in [*roles, *sorted(there - set(roles))]}
    if options.json:
        _print_json(published, beats, roles, there=there, running=running)
    else:
        _print_table(published, beats, roles, there=there, seconds=options.seconds)
        for name, of_name in running.items():
            if len(of_name) > 1:
                print(f"{name} ({roles.get(name, 'not of this configuration')}): {words_of(of_name)}; stop all but one")
    return OK


def _print_json(
    published: list[Flow],
    beats: Mapping[str, StreamStatistics],
    roles: Mapping[str, str],
    *,
    there: set[str],
    running: Mapping[str, list[Process]],
) -> None:
    for name, processes in running.items():
        about = {"type": "peer", "name": name, "role": roles.get(name), "there": name in there}
        print(json.dumps(about | {"processes": [asdict(process) for process in processes]}))
    for flow in published:
        beat = beats[flow.address]
        if beat.count:
            about = {"type": "key", "topic": flow.topic, "name": flow.name, "role": flow.role}
            numbers = {"messages": beat.count, "rate_hz": beat.rate, "bytes": beat.bytes / beat.count}
            print(json.dumps(about | numbers | {"step": beat.step}))


def _print_table(
    published: list[Flow],
    beats: Mapping[str, StreamStatistics],
    roles: Mapping[str, str],
    there: set[str],
    seconds: float,
) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 120, highlight=False)
    names = [f"{name} ({roles.get(name, 'not of this configuration')})" for name in roles if name in there]
    names += [f"{name} (not of this configuration)" for name in sorted(there - set(roles))]
    console.print(f"there: {', '.join(names) or 'no peer'}", soft_wrap=True)
    missing = [f"{name} ({role})" for name, role in roles.items() if name not in there]
    if missing:
        console.print(f"not there: {', '.join(missing)}", soft_wrap=True)
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("key")
    for title in ("messages", "rate", "bytes each", "newest step"):
        table.add_column(title, justify="right")
    for flow in published:
        beat = beats[flow.address]
        if beat.count:
            rate = "–" if beat.rate is None else f"{beat.rate:.1f} Hz"
            table.add_row(flow.address, str(beat.count), rate, f"{beat.bytes / beat.count:.0f}", str(beat.step))
    console.print(table)
    silent = [flow.address for flow in published if not beats[flow.address].count and flow.topic != "event"]
    if silent:
        console.print(f"nothing in {seconds:g} s on: {', '.join(silent)}", soft_wrap=True)
