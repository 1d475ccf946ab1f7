"""``lsu-mesh simulate``: a whole mesh in one process under seeded faults, and the line that repeats a failing seed."""

from __future__ import annotations

import argparse
import json
import math
import os
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from lsu_mesh.mesh.config import ConfigurationError, load
from lsu_mesh.mesh.simulator.campaign import CHUNK, Tally, run_seeds
from lsu_mesh.mesh.simulator.faults import parse_faults
from lsu_mesh.mesh.simulator.run import Outcome
from lsu_mesh_services.bank_limits import refuses_bank
from lsu_mesh_services.configuration import DEMO, print_problems
from lsu_mesh_services.exit_codes import NOT_MET, OK, USAGE
from lsu_mesh_services.stop import Stop


def main(options: argparse.Namespace) -> int:
    path = DEMO if options.file is None else Path(options.file)
    try:
        faults = parse_faults(options.faults)
    except ValueError as error:
        print(f"--faults {options.faults}: {error}", file=sys.stderr)
        return USAGE
    try:
        configuration = load(path)
    except ConfigurationError as error:
        print_problems(error)
        return USAGE
    if refuses_bank(configuration, "simulate"):
        return USAGE
    sensors = configuration.sensors.values()
    has_plant = configuration.plant is not None or any(sensor.is_live for sensor in sensors)
    if not has_plant or any(sensor.file or sensor.faults for sensor in sensors):
        print(
            f"{path}: needs a simulated plant or external sensors, and sensors that play no file and do not lie",
            file=sys.stderr,
        )
        return USAGE
    if options.steps < 1 or options.seeds < 1:
        print("--steps and --seeds count from 1", file=sys.stderr)
        return USAGE
    one = options.seed
    seeds = range(options.first, options.first + options.seeds) if one is None else range(one, one + 1)
    tally, began = Tally(), time.monotonic()
    end = math.inf if options.minutes is None else began + 60.0 * options.minutes
    workers = options.workers or os.cpu_count() or 1
    stop = Stop()
    if workers > 1 and len(seeds) > CHUNK:
        _interrupt_while_waiting(stop)
    try:
        for outcome in run_seeds(path, seeds, options.steps, faults=faults, workers=workers):
            tally.add(outcome)
            _tell(outcome, options)
            if stop or time.monotonic() > end:
                break
    except KeyboardInterrupt:
        stop.is_set = True
    if stop:
        print("stopped; the seeds so far:", file=sys.stderr)
    _sum_up(tally, seeds, time.monotonic() - began, options)
    return NOT_MET if tally.broken else OK


def _interrupt_while_waiting(stop: Stop) -> None:
    """End the wait for other processes at once; where seeds run in this one, compiled code must not be torn open."""

    def handle(number: int, frame: FrameType | None) -> None:
        if not stop.is_set:
            raise KeyboardInterrupt
        os._exit(130)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handle)


def _tell(outcome: Outcome, options: argparse.Namespace) -> None:
    if not outcome.broken:
        return
    line = repeating_line(outcome, options)
    if options.json:
        about = {"type": "broken", "seed": outcome.seed, "what": outcome.broken, "mesh": outcome.variant}
        print(json.dumps(about | {"repeat": line}), flush=True)
    else:
        print(f"seed {outcome.seed} ({outcome.variant}): {outcome.broken}\n  repeat: {line}", flush=True)


def repeating_line(outcome: Outcome, options: argparse.Namespace) -> str:
    """The command that runs a seed again."""
    file = [] if options.file is None else [options.file]
    words = ["lsu-mesh", "simulate", *file, "--seed", str(outcome.seed), "--steps", str(outcome.steps)]
    return " ".join([*words, "--faults", options.faults])


def _sum_up(tally: Tally, seeds: Sequence[int], seconds: float, options: argparse.Namespace) -> None:
    rate = tally.steps / seconds
    if options.json:
        about = {"type": "sum", "seeds": tally.seeds, "steps": tally.steps, "sets": tally.sets, "seconds": seconds}
        print(json.dumps(about | {"rate": rate, "broken": len(tally.broken), "counts": dict(tally.counts)}))
        return
    counts = tally.counts
    carried = counts.pop("carried", 0)
    happened = ", ".join(f"{count:,} {kind}" for kind, count in counts.items() if count)
    print(
        f"{tally.seeds:,} seeds from {seeds[0]}, {tally.steps:,} mesh steps in {seconds:,.0f} s: {rate:,.0f} steps/s\n"
        f"{carried:,} messages carried; {happened or 'no faults'}\n"
        f"{tally.sets:,} published sets checked; invariants broken in {len(tally.broken):,} seeds"
    )
