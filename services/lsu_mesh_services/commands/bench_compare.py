"""``lsu-mesh bench compare A.json B.json``: two results of the same measurement as a table of ratios."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lsu_mesh_services.exit_codes import OK, USAGE

if TYPE_CHECKING:
    from lsu_mesh.experiments.mesh_speed.bench_file import BenchFile
    from lsu_mesh.experiments.mesh_speed.comparison import Comparison


def main(options: argparse.Namespace) -> int:
    from lsu_mesh.errors import ModelError
    from lsu_mesh.experiments.mesh_speed.bench_file import read_bench_file
    from lsu_mesh.experiments.mesh_speed.comparison import compare_files

    try:
        a, b = (read_bench_file(Path(name)) for name in (options.first, options.second))
        found = compare_files(a, b)
    except ModelError as error:
        print(f"bench compare: {error}", file=sys.stderr)
        return USAGE
    if options.json:
        for row in found.rows:
            print(json.dumps({"type": "comparison", "what": a.what, **row._asdict()}))
    else:
        _print(found, a, b)
    return OK


def _print(found: Comparison, a: BenchFile, b: BenchFile) -> None:
    from lsu_mesh_services.benchmarks.table import new_console, number, print_rows

    console = new_console()
    rows, before = [], ""
    for row in found.rows:
        rows.append((row.case if row.case != before else "", row.measure, number(row.ratio), row.verdict))
        before = row.case
    named = [f"{name}: commit {file.commit or 'unknown'}, {file.date}" for name, file in (("A", a), ("B", b))]
    print_rows(console, "; ".join(named), (a.what, "", "B ÷ A", "B is"), rows)
    for words in found.only_one:
        console.print(f"only in one of the files: {words}", markup=False, soft_wrap=True)
    for words in found.differs:
        console.print(f"the machines differ in {words}", markup=False, soft_wrap=True)
