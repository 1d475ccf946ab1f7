"""``lsu-mesh bench mesh``: latency and processor time of a real mesh beside a relay that does no work."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lsu_mesh_services.benchmarks.checkout import DoesNotCompile, compile_kernels, tree_refusal
from lsu_mesh_services.exit_codes import COULD_NOT_START, FAILURE, OK, USAGE

if TYPE_CHECKING:
    from lsu_mesh.experiments.mesh_speed.mesh_case import MeshCase

MIN_SECONDS, MAX_SECONDS, MAX_TURNS = 1.0, 600.0, 100


def main(options: argparse.Namespace) -> int:
    from lsu_mesh.errors import ModelError
    from lsu_mesh.experiments.mesh_speed.mesh_case import cases
    from lsu_mesh_services.benchmarks import keep_results

    try:
        wanted = cases(options.rate, options.filters, recorder=options.recorder)
    except ModelError as error:
        print(f"bench mesh: {error}", file=sys.stderr)
        return USAGE
    if words := _refusal(options) or keep_results.refusal(options):
        print(f"bench mesh: {words}", file=sys.stderr)
        return USAGE
    tree = None if options.tree is None else Path(options.tree).resolve()
    try:
        compile_kernels(tree)
    except DoesNotCompile as error:
        print(f"bench mesh: {error}", file=sys.stderr)
        return COULD_NOT_START
    lines: list[dict[str, Any]] = []
    code = _measure(wanted, options, tree, lines=lines)
    if lines:
        if not options.json:
            print_table(lines)
        keep_results.keep(options, "mesh", lines, tree=tree)
    return code


def _measure(
    wanted: Sequence[MeshCase], options: argparse.Namespace, tree: Path | None, *, lines: list[dict[str, Any]]
) -> int:
    """Append the line of each case; what was measured before a failure stays."""
    from lsu_mesh_services.benchmarks.process_group import DidNotRun
    from lsu_mesh_services.benchmarks.turns import measure_case

    for case in wanted:
        try:
            report = measure_case(case, turns=options.turns, seconds=options.seconds, tree=tree, tell=_tell)
        except DidNotRun as error:
            print(f"bench mesh, {case.words}: {error}", file=sys.stderr)
            return FAILURE
        lines.append(report.line())
        if words := too_busy(lines[-1]):
            print(f"bench mesh, {case.words}: {words}", file=sys.stderr)
        if options.json:
            print(json.dumps(lines[-1]), flush=True)
    return OK


def too_busy(line: dict[str, Any]) -> str:
    """A warning where a side did not keep up with its steps; "" where both did."""
    from lsu_mesh.experiments.mesh_speed.mesh_report import keeps_up

    counts = {side: line[side]["missing"] for side in ("relay", "mesh")}
    lost = {side: count for side, count in counts.items() if not keeps_up(count, line["steps"])}
    if not lost:
        return ""
    sides = " and ".join(f"the {side} ({count} of {line['steps']} fused sets missing)" for side, count in lost.items())
    return f"{sides} did not keep up: the latencies say that the machine is too small or too busy, and nothing else"


def _refusal(options: argparse.Namespace) -> str:
    if not MIN_SECONDS <= options.seconds <= MAX_SECONDS:
        return f"--seconds {options.seconds:g}: expected {MIN_SECONDS:g} to {MAX_SECONDS:g}"
    if not 1 <= options.turns <= MAX_TURNS:
        return f"--turns {options.turns}: expected 1 to {MAX_TURNS}"
    return tree_refusal(options.tree)


def _tell(words: str) -> None:
    print(f"measuring {words} …", file=sys.stderr, flush=True)


def print_table(lines: Sequence[dict[str, Any]]) -> None:
    """Milliseconds of relay and mesh, and their ratios."""
    from lsu_mesh.experiments.mesh_speed.bench_kinds import KINDS
    from lsu_mesh_services.benchmarks.table import new_console, number, print_rows

    console = new_console()
    rows = []
    for line in lines:
        words = KINDS["mesh"].case_words(line)
        for name in ("p50", "p99", "p999"):
            relay, mesh = line["relay"][f"{name}_ms"], line["mesh"][f"{name}_ms"]
            label = f"p{name[1:3]}.{name[3:]}" if name == "p999" else name
            rows.append((words, label, number(relay), number(mesh), number(line[f"{name}_ratio"])))
            words = ""
        rows.append(
            ("", "processor a step", number(line["relay_cpu_ms_per_step"]), number(line["cpu_ms_per_step"]),
             number(line["cpu_ratio"]))
        )  # fmt: skip
    heads = ("case", "", "relay, ms", "mesh, ms", "mesh ÷ relay")
    print_rows(console, "From the intended time of a step to its fused set at one subscriber", heads, rows)
    for line in lines:
        words = KINDS["mesh"].case_words(line)
        spread = f"p50 of single turns {line['p50_ratio_least']:.3g} to {line['p50_ratio_most']:.3g} times the relay's"
        lost = ", ".join(
            f"{side} {what} {line[side][what]}"
            for side in ("relay", "mesh")
            for what in ("missing", "incomplete")
            if line[side][what]
        )
        console.print(
            f"{words}: {line['steps']} steps, {spread}{'; fused sets: ' + lost if lost else ''}",
            markup=False, soft_wrap=True,
        )  # fmt: skip
