"""``lsu-mesh reproduce WHAT``: run an experiment of the library, print or write its tables, checks and figures."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from lsu_mesh.experiments.outcome import Outcome, Table
from services.cli import COULD_NOT_START, NOT_MET, OK, USAGE

MODULES = {"fusion": ("fusion", "transfer")}
"""The experiments that stand behind each choice; ``services.cli.REPRODUCIBLE`` says what they are."""


def main(options: argparse.Namespace) -> int:
    folder = None if options.out is None else Path(options.out)
    if folder is not None:
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            print("figures need matplotlib: pip install 'lsu-mesh[plots]'", file=sys.stderr)
            return COULD_NOT_START
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            print(f"{folder}: cannot be made: {error.strerror}", file=sys.stderr)
            return USAGE
    are_met = True
    for name in MODULES[options.what]:
        outcome: Outcome = importlib.import_module(f"lsu_mesh.experiments.{name}").run(options.quick, options.seed)
        _print_json(outcome) if options.json else _print_tables(outcome)
        for path in () if folder is None else _write(outcome, folder):
            print(f"wrote {path}", file=sys.stderr)
        are_met = are_met and all(check.is_met for check in outcome.checks)
    return OK if are_met else NOT_MET


def _print_tables(outcome: Outcome) -> None:
    """Tables with rich where it is installed, else plain; the checks below."""
    for table in outcome.tables:
        if not table.is_for_files:
            _print_table(table)
    for check in outcome.checks:
        print(check)
    print()


def _print_table(table: Table) -> None:
    try:
        from rich.console import Console
        from rich.table import Table as Grid
    except ImportError:
        print(table.plain(), end="\n\n")
        return
    grid = Grid(box=None, pad_edge=False, header_style="bold", title=table.title, title_justify="left")
    for i, column in enumerate(table.columns):
        grid.add_column(column.title, justify="right" if table.is_numeric(i) else "left")
    for row in table.printed():
        grid.add_row(*row)
    console = Console(width=None if sys.stdout.isatty() else 160, highlight=False)
    console.print(grid)
    console.print()


def _print_json(outcome: Outcome) -> None:
    """One line per row of each table and one per check."""
    for table in outcome.tables:
        for record in table.records():
            print(json.dumps({"type": "row", "table": table.name, **record}, ensure_ascii=False))
    for check in outcome.checks:
        print(json.dumps({"type": "check", **check._asdict(), "met": check.is_met}, ensure_ascii=False))


def _write(outcome: Outcome, folder: Path) -> Iterator[Path]:
    """Tables as CSV and Markdown, figures as PNG; the paths that were written."""
    for table in outcome.tables:
        files = {".csv": table.csv()} if table.is_for_files else {".csv": table.csv(), ".md": table.markdown()}
        for suffix, text in files.items():
            path = folder / f"{table.name}{suffix}"
            path.write_text(text, encoding="utf-8")
            yield path
    for name, draw in outcome.figures.items():
        path = folder / f"{name}.png"
        draw().savefig(path, dpi=90)
        yield path
