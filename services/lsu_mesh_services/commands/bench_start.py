"""``lsu-mesh bench start``: time from the start of a mesh to its first fused set, and the memory of each role."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lsu_mesh_services.benchmarks.checkout import DoesNotCompile, compile_kernels, tree_refusal
from lsu_mesh_services.exit_codes import COULD_NOT_START, FAILURE, OK, USAGE

MAX_SECONDS, MAX_TURNS = 600.0, 100


def main(options: argparse.Namespace) -> int:
    from lsu_mesh.experiments.mesh_speed.start_report import start_lines
    from lsu_mesh_services.benchmarks import keep_results
    from lsu_mesh_services.benchmarks.process_group import DidNotRun
    from lsu_mesh_services.benchmarks.start import one_start

    if words := _refusal(options) or keep_results.refusal(options):
        print(f"bench start: {words}", file=sys.stderr)
        return USAGE
    tree = None if options.tree is None else Path(options.tree).resolve()
    starts = []
    try:
        compile_kernels(tree)
        for turn in range(options.turns):
            print(f"start {turn + 1} of {options.turns} …", file=sys.stderr, flush=True)
            starts.append(one_start(options.seconds, recorder=options.recorder, tree=tree))
    except DoesNotCompile as error:
        print(f"bench start: {error}", file=sys.stderr)
        return COULD_NOT_START
    except DidNotRun as error:
        print(f"bench start: {error}", file=sys.stderr)
        return FAILURE
    lines = start_lines(starts)
    if options.json:
        for line in lines:
            print(json.dumps(line))
    else:
        print_table(lines)
    keep_results.keep(options, "start", lines, tree=tree)
    return OK


def _refusal(options: argparse.Namespace) -> str:
    if not 0 <= options.seconds <= MAX_SECONDS:
        return f"--seconds {options.seconds:g}: expected 0 to {MAX_SECONDS:g}"
    if not 1 <= options.turns <= MAX_TURNS:
        return f"--turns {options.turns}: expected 1 to {MAX_TURNS}"
    return tree_refusal(options.tree)


def print_table(lines: Sequence[dict[str, Any]]) -> None:
    """Times, then memory."""
    from lsu_mesh_services.benchmarks.table import new_console, number, print_rows

    console = new_console()
    times = [
        (line["what"], number(line["seconds"]), number(line.get("processor_s")) if "processor_s" in line else "")
        for line in lines if "seconds" in line
    ]  # fmt: skip
    print_rows(console, "From the start of the first process, kernels compiled", ("", "s", "of processors, s"), times)
    memory = [(line["what"], number(line["rss_mib"])) for line in lines if "rss_mib" in line]
    print_rows(console, "Resident memory of the largest process of a role", ("", "MiB"), memory)
