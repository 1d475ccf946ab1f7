"""``lsu-mesh replay FILE``: the recorded data through filters and fusions again, as fast as it goes."""

from __future__ import annotations

import argparse
import gc
import heapq
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from lsu_mesh.mesh.config import Configuration, ConfigurationError, load, load_values
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Truth, encode
from lsu_mesh.mesh.replay import SOURCES, Replay, Timed
from lsu_mesh_services.configuration import print_problems
from lsu_mesh_services.exit_codes import COULD_NOT_START, NOT_MET, OK, USAGE
from lsu_mesh_services.monitoring.run_report import Row, RunReport
from lsu_mesh_services.monitoring.table import share
from lsu_mesh_services.recording.read import Received, Recording
from lsu_mesh_services.replay.compare import CannotReplay, beside
from lsu_mesh_services.replay.smooth import SmoothedRow, json_lines, print_rows, smoothed_rows, with_lag


def replay_again(recording: Recording, options: argparse.Namespace) -> int:
    """Replay, print what came of it, and write a recording where one is asked for; the exit code."""
    try:
        replayed, shown = configurations(recording, options)
    except ConfigurationError as error:
        print_problems(error)
        return USAGE
    except CannotReplay as error:
        print(error, file=sys.stderr)
        return USAGE
    made, seconds = _run(replayed, recording)
    target = _target(recording, options)
    if target is not None:
        try:
            _write(shown, target, recording, made, keeps_old=is_comparison(options))
        except OSError as error:
            text = error.strerror or str(error)
            print(f"replay: cannot write {target}: {text}; choose another place with --record", file=sys.stderr)
            return COULD_NOT_START
    _print(recording, replayed, made, seconds=seconds, target=target, options=options)
    return OK if made else NOT_MET


def is_comparison(options: argparse.Namespace) -> bool:
    """Whether other filters run on the recorded data."""
    return options.other is not None or options.smooth is not None or bool(model_changes(options))


def model_changes(options: argparse.Namespace) -> list[str]:
    """The flags that change what is computed, and not where the mesh is."""
    return [change for change in options.overrides if not change.startswith("network.")]


def configurations(recording: Recording, options: argparse.Namespace) -> tuple[Configuration, Configuration]:
    """What runs, and what a recording of it shows.

    Raises ``ConfigurationError`` where the other configuration is wrong, ``CannotReplay`` where it does not fit.
    """
    old = recording.configuration
    if not is_comparison(options):
        return old, old
    if options.other is None:
        other = load_values(old.values, old.path, model_changes(options), reads_files=False)
    else:
        other = load(Path(options.other), model_changes(options), os.environ, reads_files=False)
    if options.smooth is not None:
        other = with_lag(other, options.smooth)
    return beside(old, other)


def _run(configuration: Configuration, recording: Recording) -> tuple[list[Timed], float]:
    """Everything that the nodes publish, and how long it took once the kernels were loaded."""
    replay = Replay(configuration, (Timed(one.arrival_ns, one.message) for one in recording.received))
    for node in replay.nodes.values():
        node.warm_up()
    gc.disable()  # nearly all that is made stays: to search it for garbage takes an eighth of a replay
    try:
        began = time.perf_counter()
        made = list(replay.run())
        return made, time.perf_counter() - began
    finally:
        gc.enable()


def _target(recording: Recording, options: argparse.Namespace) -> Path | None:
    """Where the replay is recorded: as asked for; a comparison beside the recording."""
    if options.record is not None:
        return Path(options.record)
    if not is_comparison(options):
        return None
    file = recording.files[0]
    changed = "smoothing" if options.smooth is not None else "changed"
    words = changed if options.other is None else Path(options.other).stem
    target, number = file.with_name(f"{file.stem}-with-{words}{file.suffix}"), 1
    while target.exists():
        number += 1
        target = file.with_name(f"{file.stem}-with-{words}-{number}{file.suffix}")
    return target


def _write(
    configuration: Configuration, target: Path, recording: Recording, made: Sequence[Timed], *, keeps_old: bool
) -> None:
    """A recording of the data and the new sets, with the recorded sets and events if ``keeps_old``."""
    from lsu_mesh_services.recording.recorder import Recorder

    properties = {"replay_of": str(recording.files[0].resolve())}
    recorder = Recorder(configuration, target, run_properties=properties)
    old = [one for one in recording.received if keeps_old or isinstance(one.message, SOURCES)]
    for role, name in configuration.peers():
        recorder.peer_changed(role, name, True, old[0].arrival_ns if old else 0)
    new = _received(configuration.mesh.name, made)
    for one in heapq.merge(old, new, key=lambda received: received.arrival_ns):
        recorder.record(one.key, one.payload, one.arrival_ns, one.message)
        recorder.tick(one.arrival_ns)
    recorder.close()
    for problem in recorder.problems:
        print(f"replay: {target}: {problem}", file=sys.stderr)


def _received(mesh: str, made: Sequence[Timed]) -> Iterator[Received]:
    for now, message in made:
        yield Received(now, key(mesh, message.topic, message.name), encode(message), message)


def _print(
    recording: Recording,
    replayed: Configuration,
    made: Sequence[Timed],
    seconds: float,
    target: Path | None,
    options: argparse.Namespace,
) -> None:
    old, new = RunReport(recording.configuration), RunReport(replayed)
    for one in recording.received:
        old.record(one.message, one.arrival_ns)
    sources = [(one.arrival_ns, one.message) for one in recording.received if isinstance(one.message, SOURCES)]
    for now, message in sorted([*sources, *made], key=lambda timed: timed[0]):
        new.record(message, now)
    rows = [("recorded", row) for row in old.rows()] + [("replayed", row) for row in new.rows()]
    smoothed = [] if options.smooth is None else _smoothed(recording, made)
    run = max((row.last_step for _, row in rows), default=0) / recording.configuration.mesh.rate
    speed = run / seconds if seconds else 0.0
    if options.json:
        for what, row in rows:
            print(json.dumps({"type": "estimator", "run": what, **asdict(row)}))
        for line in json_lines(smoothed):
            print(line)
        recorded = None if target is None else str(target)
        print(json.dumps({"type": "replay", "seconds": seconds, "times_real_time": speed, "recording": recorded}))
        return
    _print_table(rows)
    if options.smooth is not None:
        print_rows(smoothed, options.smooth)
    print(f"{run:.4g} s of the run in {seconds:.3g} s: {speed:.3g} × real time")
    if target is not None:
        print(f"recorded in {target}")


def _smoothed(recording: Recording, made: Sequence[Timed]) -> list[SmoothedRow]:
    truth = {one.message.step: one.message.x for one in recording.received if isinstance(one.message, Truth)}
    return smoothed_rows([message for _, message in made], truth)


def _print_table(rows: Sequence[tuple[str, Row]]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 120, highlight=False)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("", "", "kind"):
        table.add_column(title)
    for title in ("steps", "RMSE", "truth inside", "mean width", "inconsistent"):
        table.add_column(title, justify="right")
    for what, row in rows:
        rmse = "–" if row.rmse is None else f"{row.rmse:.4f}"
        inside = share(row.inside)
        width = "–" if row.width is None else f"{row.width:.4f}"
        table.add_row(what, row.name, row.kind, str(row.steps), rmse, inside, width, str(row.inconsistent))
    console.print(table)
