"""``lsu-mesh bench throughput``: steps a second of single nodes without a network, and of what is around them."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from lsu_mesh_services.exit_codes import OK, USAGE

if TYPE_CHECKING:
    from lsu_mesh.experiments.mesh_speed.throughput import Throughput

QUEUE_BYTES = 1000


def main(options: argparse.Namespace) -> int:
    from lsu_mesh.experiments.mesh_speed.throughput import FULL, QUICK, throughput
    from lsu_mesh_services.benchmarks import keep_results
    from lsu_mesh_services.network.receive_queue import Arrival, ReceiveQueue

    if words := keep_results.refusal(options):
        print(f"bench throughput: {words}", file=sys.stderr)
        return USAGE
    queue, arrival = ReceiveQueue(), Arrival("sample", "bench", bytes(QUEUE_BYTES), 0)

    def through_the_queue() -> None:
        queue.put(arrival)
        queue.next(0)

    effort = QUICK if options.quick else FULL
    print("measuring nodes, decoding, encoding and the queue …", file=sys.stderr, flush=True)
    found = throughput(effort, {"queue a message and take it": through_the_queue})
    lines = [row.line() for row in found]
    if options.json:
        for line in lines:
            print(json.dumps(line))
    else:
        print_table(found)
    keep_results.keep(options, "throughput", lines)
    return OK


def print_table(found: Sequence[Throughput]) -> None:
    """The rates, and whether those that are demanded are met."""
    from lsu_mesh_services.benchmarks.table import new_console, number, print_rows

    verdicts = {True: "met", False: "not met", None: ""}
    rows = [
        (
            row.what, number(row.per_second), number(row.best_per_second),
            "" if row.demanded is None else f"≥ {number(row.demanded)}", verdicts[row.is_met],
        )
        for row in found
    ]  # fmt: skip
    console = new_console()
    heads = ("", "a second", "best round", "demanded", "")
    print_rows(console, "One node on one core: decoding, admission, step, encoding; no network", heads, rows)
    cores = os.cpu_count() or 1
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    if load > cores:
        console.print(
            f"the load is {load:.1f} on {cores} processors: shared cores are slower than those of an idle machine",
            markup=False, soft_wrap=True,
        )  # fmt: skip
