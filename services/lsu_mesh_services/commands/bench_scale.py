"""``lsu-mesh bench scale``: cost against processes, sources, states and instances, and the page of projections."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from lsu_mesh_services.benchmarks.checkout import DoesNotCompile, compile_kernels
from lsu_mesh_services.exit_codes import COULD_NOT_START, FAILURE, OK, USAGE

if TYPE_CHECKING:
    from lsu_mesh.experiments.mesh_speed.scale import Cost, Effort


def main(options: argparse.Namespace) -> int:
    from lsu_mesh.experiments.mesh_speed.scale import FULL, QUICK
    from lsu_mesh_services.benchmarks import keep_results
    from lsu_mesh_services.benchmarks.process_group import DidNotRun

    if words := keep_results.refusal(options) or _refusal(options):
        print(f"bench scale: {words}", file=sys.stderr)
        return USAGE
    try:
        costs = _measure(QUICK if options.quick else FULL, options)
    except DoesNotCompile as error:
        print(f"bench scale: {error}", file=sys.stderr)
        return COULD_NOT_START
    except DidNotRun as error:
        print(f"bench scale: {error}", file=sys.stderr)
        return FAILURE
    lines = [cost.line() for cost in costs]
    if options.json:
        for line in lines:
            print(json.dumps(line))
    else:
        print_table(costs)
    if options.page is not None:
        _write_page(Path(options.page), costs)
    keep_results.keep(options, "scale", lines)
    return OK


def _refusal(options: argparse.Namespace) -> str:
    if options.page is not None and not Path(options.page).resolve().parent.is_dir():
        return f"--page {options.page}: there is no folder {Path(options.page).parent}"
    return ""


def _measure(effort: Effort, options: argparse.Namespace) -> list[Cost]:
    from lsu_mesh.experiments.mesh_speed.scale import bank_costs, source_costs, state_costs

    found: list[Cost] = []
    if not options.no_processes:
        from lsu_mesh_services.benchmarks.process_costs import process_costs

        compile_kernels(None)
        found += process_costs(effort.filters, effort.mesh_seconds, _tell)
    _tell("sources of a fusion")
    found += source_costs(effort.sources, effort.steps, effort.rounds)
    _tell("states of a filter")
    found += state_costs(effort.states, effort.steps, effort.rounds)
    _tell("instances of a bank")
    return found + bank_costs(effort.instances, effort.rounds, effort.seconds)


def _tell(words: str) -> None:
    print(f"measuring {words} …", file=sys.stderr, flush=True)


def _write_page(target: Path, costs: Sequence[Cost]) -> None:
    from lsu_mesh.experiments.machine_facts import machine_facts
    from lsu_mesh.experiments.mesh_speed.scale_page import scale_page
    from lsu_mesh_services.benchmarks.keep_results import PACKAGES, commit_of, own_tree

    date = datetime.now(UTC).strftime("%Y-%m-%d")
    text = scale_page(costs, date=date, commit=commit_of(own_tree()), machine=machine_facts(PACKAGES))
    target.write_text(text, encoding="utf-8")
    print(f"page: {target}", file=sys.stderr)


def print_table(costs: Sequence[Cost]) -> None:
    """Costs, and how they grow."""
    from lsu_mesh.experiments.mesh_speed.growth import exponent
    from lsu_mesh_services.benchmarks.table import new_console, number, print_rows

    rows, exponents = [], []
    for what in dict.fromkeys(cost.what for cost in costs):
        group = [cost for cost in costs if cost.what == what]
        for k, cost in enumerate(group):
            ratio = number(cost.cost / group[0].cost)
            unit = cost.unit if cost.kept_up else f"{cost.unit}, steps lost"
            rows.append((what if k == 0 else "", str(cost.count), number(cost.cost), unit, ratio))
        if len(group) > 1:
            exponents.append(f"{what} {exponent([(float(cost.count), cost.cost) for cost in group]):.2f}")
    console = new_console()
    print_rows(console, "Cost against size", ("", "count", "cost", "", "÷ the first"), rows)
    console.print(f"growth, exponent of the upper half: {'; '.join(exponents)}", markup=False, soft_wrap=True)
