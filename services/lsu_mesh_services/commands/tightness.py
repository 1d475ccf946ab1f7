"""``lsu-mesh bench tightness --benchmarks FILE …``: hulls beside the exact ones and the published estimators."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lsu_mesh_services.exit_codes import OK, USAGE

if TYPE_CHECKING:
    from lsu_mesh.experiments.tightness import Benchmark, Tightness


def main(options: argparse.Namespace) -> int:
    from lsu_mesh.errors import ModelError
    from lsu_mesh.experiments import tightness

    if not options.benchmarks:
        print("give the JSON files of the benchmarks: lsu-mesh bench tightness --benchmarks FILE …", file=sys.stderr)
        return USAGE
    try:
        benchmarks = [tightness.read_benchmark(Path(name)) for name in options.benchmarks]
    except ModelError as error:
        print(error, file=sys.stderr)
        return USAGE
    for benchmark in benchmarks:
        print(f"running {benchmark.name} …", file=sys.stderr, flush=True)
        found = tightness.measure(benchmark, tightness.FILTERS)
        if options.json:
            own = [row._asdict() for row in found]
            print(json.dumps({"benchmark": benchmark.name, "own": own, "published": benchmark.published}))
        else:
            _print_table(benchmark, found)
    return OK


def _print_table(benchmark: Benchmark, found: Sequence[Tightness]) -> None:
    """Own filters and published estimators, the tightest first."""
    from rich.console import Console
    from rich.table import Table

    rows = [(row.mean_ratio, row.filter, f"{row.cut_off:.1e}") for row in found]
    rows += [(ratio, f"published: {name}", "") for name, ratio in benchmark.published.items()]
    table = Table(box=None, pad_edge=False, header_style="bold")
    for head, justify in (("estimator", "left"), ("radius ÷ exact", "right"), ("cuts off at most", "right")):
        table.add_column(head, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    for ratio, name, cut_off in sorted(rows):
        table.add_row(name, f"{ratio:.6f}" if ratio < 1.0001 else f"{ratio:.3f}", cut_off)
    console = Console(width=None if sys.stdout.isatty() else 120, highlight=False)
    model = benchmark.model
    console.print(
        f"\n{benchmark.name}: {model.state_count} states, {model.output_count} outputs, row {benchmark.last}",
        markup=False,
    )
    console.print(table)
