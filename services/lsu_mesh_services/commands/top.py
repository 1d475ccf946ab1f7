"""``lsu-mesh top``: the state of every peer, live."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

from lsu_mesh.mesh.access import published_topics
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Health
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.observer import HealthObserver, PeerHealth, worst
from lsu_mesh_services.exit_codes import NOT_MET, OK
from lsu_mesh_services.monitoring.stream_statistics import StreamStatistics
from lsu_mesh_services.monitoring.subscriber import Heard, Watch, run_tool, watching

RECENT = 100
"""Rate and latency are those of so many messages."""
REFRESH_NS = SECOND // 2
STYLES = {"OK": "green", "WARN": "yellow", "ERROR": "red", "STALE": "magenta"}


class Row(NamedTuple):
    """One peer."""

    health: PeerHealth
    step: int
    rate: float | None
    latency_ms: float | None

    def counter(self, name: str) -> float | None:
        """One that the peer tells of itself."""
        return self.health.counters.get(name)


@dataclass
class Board:
    """What is known of every peer."""

    configuration: Configuration
    observer: HealthObserver
    beats: dict[str, StreamStatistics] = field(default_factory=dict)
    """By peer, of what it publishes last in each step."""

    def record(self, heard: Heard) -> None:
        """Something has come."""
        if heard.message is None:
            self.observer.record_presence(heard.name, heard.is_there)
        elif isinstance(heard.message, Health):
            self.observer.record(heard.message, heard.arrival_ns)
        else:
            beat = self.beats.setdefault(heard.name, StreamStatistics(RECENT))
            beat.record(heard.arrival_ns, heard.message.sent_ns, heard.size, heard.message.step)

    def rows(self, now: int) -> list[Row]:
        """Every peer as it is now."""
        found = []
        for health in self.observer.peers(now):
            beat = self.beats.get(health.name, StreamStatistics())
            is_silent = health.level == "STALE"
            step = max(health.step, beat.step)
            found.append(Row(health, step, None if is_silent else beat.rate, beat.latency_ms(0.5)))
        return found


def main(options: argparse.Namespace) -> int:
    return run_tool(options, _watch)


def _watch(configuration: Configuration, options: argparse.Namespace) -> int:
    listed = [(published_topics(configuration, role, name), name) for role, name in configuration.peers()]
    main_topics = [(topics[-1], name) for topics, name in listed if topics]
    if not configuration.base_model.input_count and configuration.plant is not None and configuration.instances is None:
        main_topics.append(("truth", configuration.plant.name))
    health = [("health", name) for _, name in configuration.peers()]
    with watching(configuration, options) as watch:
        board = Board(configuration, HealthObserver(configuration, watch.clock.now()))
        watch.listen([*main_topics, *health])
        once = options.once or options.json or not sys.stdout.isatty()
        rows = _listen(watch, board, options.seconds) if once else _follow(watch, board)
        watch.tell_refused()
    if options.json:
        for row in rows:
            print(json.dumps(record(row)))
    elif once:
        from rich.console import Console

        console = Console(width=None if sys.stdout.isatty() else 120, highlight=False)
        console.print(table(rows))
        for words in reasons(rows):
            console.print(words, markup=False, soft_wrap=True)
    return OK if not once or worst([row.health.level for row in rows]) == "OK" else NOT_MET


def _listen(watch: Watch, board: Board, seconds: float) -> list[Row]:
    for heard in watch.received(seconds):
        if heard is not None:
            board.record(heard)
    return board.rows(watch.clock.now())


def _follow(watch: Watch, board: Board) -> list[Row]:
    """Until stopped, on the terminal."""
    from rich.console import Group
    from rich.live import Live
    from rich.text import Text

    def drawn() -> Group:
        rows = board.rows(watch.clock.now())
        return Group(table(rows), *(Text(words) for words in reasons(rows)))

    with Live(drawn(), screen=True, auto_refresh=False) as live:
        shown = watch.clock.now()
        for heard in watch.received():
            if heard is not None:
                board.record(heard)
            if watch.clock.now() - shown > REFRESH_NS:
                shown = watch.clock.now()
                live.update(drawn(), refresh=True)
    return board.rows(watch.clock.now())


def table(rows: Sequence[Row]) -> Any:
    """One row per peer, for a terminal."""
    from rich.table import Table

    found = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("peer", "role", "level"):
        found.add_column(title)
    for title in ("step", "rate", "latency", "gaps", "dropped", "queue", "step time", "heard"):
        found.add_column(title, justify="right")
    for row in rows:
        health, age = row.health, row.health.age_ns
        level = f"[{STYLES[health.level]}]{health.level}[/]"
        counts = [_shown(row.counter(name), "g") for name in ("gaps", "dropped", "queue")]
        cells = [str(row.step), _shown(row.rate, ".1f", " Hz"), _shown(row.latency_ms, ".2f", " ms"), *counts]
        cells += [_shown(row.counter("step_ms"), ".1f", " ms")]
        cells += [_shown(None if age is None else age / SECOND, ".1f", " s ago")]
        found.add_row(health.name, health.role, level, *cells)
    return found


def reasons(rows: Sequence[Row]) -> list[str]:
    """Why peers are not well, and how the mesh is."""
    found = [
        f"{row.health.level} {row.health.role}/{row.health.name}: {why}" for row in rows for why in row.health.reasons
    ]
    return [*found, f"the mesh: {worst([row.health.level for row in rows])}"]


def record(row: Row) -> dict[str, Any]:
    """For programs."""
    health = row.health
    counters = {name: row.counter(name) for name in ("gaps", "dropped", "queue", "queue_ms", "step_ms")}
    return {
        "name": health.name, "role": health.role, "level": health.level, "reasons": list(health.reasons),
        "step": row.step, "rate_hz": row.rate, "latency_ms": row.latency_ms, **counters,
        "age_s": None if health.age_ns is None else health.age_ns / SECOND,
        "started_ns": health.started_ns, "host": health.host,
        "processes": [asdict(process) for process in health.processes],
    }  # fmt: skip


def _shown(value: float | None, form: str, unit: str = "") -> str:
    return "–" if value is None else f"{value:{form}}{unit}"
