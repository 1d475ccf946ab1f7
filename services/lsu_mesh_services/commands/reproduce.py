"""``lsu-mesh reproduce WHAT``: run an experiment of the library, print or write its tables, checks and figures."""

from __future__ import annotations

import argparse
import importlib
import io
import json
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from lsu_mesh.errors import LsuMeshError
from lsu_mesh.experiments.outcome import Outcome, Table
from lsu_mesh.experiments.page import page
from lsu_mesh.experiments.workers import Watch, part, shared_processes
from lsu_mesh_services.exit_codes import COULD_NOT_START, FAILURE, NOT_MET, OK, USAGE
from lsu_mesh_services.monitoring.progress import ShareDone
from lsu_mesh_services.options.reproduce import ALL, REPRODUCIBLE, WITH_BENCHMARKS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "papers"
"""Stem of the page of ``all``, and the folder of its files."""
DOTS_PER_INCH = 90
COLOURS = 160


def main(options: argparse.Namespace) -> int:
    refusal = _refusal(options)
    if refusal:
        print(refusal, file=sys.stderr)
        return USAGE
    folder = None if options.out is None else Path(options.out)
    if folder is not None and not _has_matplotlib():
        print("figures need matplotlib: pip install 'lsu-mesh[plots]'", file=sys.stderr)
        return COULD_NOT_START
    files = folder if folder is None or options.what != ALL else folder / PAGE
    try:
        if files is not None:
            files.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        print(f"{files}: cannot be made: {error.strerror}", file=sys.stderr)
        return USAGE
    outcomes: dict[str, list[Outcome]] = {}
    failed: list[str] = []
    with shared_processes():
        for what in _chosen(options):
            try:
                outcomes[what] = _run(what, options)
            except LsuMeshError as error:
                print(f"{what}: {error}", file=sys.stderr)
                failed.append(what)
                continue
            for outcome in outcomes[what]:
                _print_json(outcome) if options.json else _print_tables(outcome)
                for path in () if files is None else _write(outcome, files):
                    print(f"wrote {path}", file=sys.stderr)
    if folder is not None and options.what == ALL:
        _write_page({what: _joined(parts) for what, parts in outcomes.items()}, folder, options)
    if failed:
        print(f"not done: {', '.join(failed)}", file=sys.stderr)
        return FAILURE
    are_met = all(check.is_met for parts in outcomes.values() for outcome in parts for check in outcome.checks)
    return OK if are_met else NOT_MET


def _refusal(options: argparse.Namespace) -> str:
    """Why these options do not fit together, or nothing."""
    if options.what == WITH_BENCHMARKS and options.benchmarks is None:
        return f"{WITH_BENCHMARKS}: the published systems are not shipped; give their folder by --benchmarks DIR"
    if options.benchmarks is not None and options.what not in (WITH_BENCHMARKS, ALL):
        return f"--benchmarks: only {WITH_BENCHMARKS} and {ALL} read published systems, {options.what} does not"
    if options.benchmarks is not None and not Path(options.benchmarks).is_dir():
        return f"--benchmarks {options.benchmarks}: there is no such folder"
    return ""


def _has_matplotlib() -> bool:
    with suppress(ImportError):
        import matplotlib  # noqa: F401

        return True
    return False


def _chosen(options: argparse.Namespace) -> Iterator[str]:
    for what in REPRODUCIBLE:
        if options.what not in (what, ALL):
            continue
        if what == WITH_BENCHMARKS and options.benchmarks is None:
            print(f"{what} is left out: give the folder of the published systems by --benchmarks DIR", file=sys.stderr)
            continue
        yield what


def _run(what: str, options: argparse.Namespace) -> list[Outcome]:
    """The outcomes of the experiments behind one choice, with a bar on a terminal."""
    modules = REPRODUCIBLE[what].modules
    further = {"folder": Path(options.benchmarks)} if what == WITH_BENCHMARKS else {}
    outcomes = []
    with ShareDone(what) as bar:
        for i, name in enumerate(modules):
            watch: Watch = part(bar.show, i / len(modules), (i + 1) / len(modules))
            run = importlib.import_module(f"lsu_mesh.experiments.{name}").run
            outcomes.append(run(options.quick, options.seed, watch, **further))
    return outcomes


def _joined(outcomes: list[Outcome]) -> Outcome:
    """The experiments of one choice as one section of the page."""
    return Outcome(
        [table for outcome in outcomes for table in outcome.tables],
        [check for outcome in outcomes for check in outcome.checks],
        {stem: draw for outcome in outcomes for stem, draw in outcome.figures.items()},
        title=next((outcome.title for outcome in outcomes if outcome.title), ""),
        notes="\n\n".join(outcome.notes for outcome in outcomes if outcome.notes),
        captions={stem: caption for outcome in outcomes for stem, caption in outcome.captions.items()},
        errata=[line for outcome in outcomes for line in outcome.errata],
    )


def _write_page(outcomes: dict[str, Outcome], folder: Path, options: argparse.Namespace) -> None:
    quick = " --quick" if options.quick else ""
    seed = f" --seed {options.seed}" if options.seed != 1 else ""
    benchmarks = " --benchmarks DIR" if options.benchmarks is not None else ""
    path = folder / f"{PAGE}.md"
    text = page(outcomes, f"lsu-mesh reproduce {ALL}{quick}{seed}{benchmarks} --out {folder.name}", PAGE)
    path.write_text(text, encoding="utf-8")
    print(f"wrote {path}", file=sys.stderr)


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
            print(_line({"type": "row", "table": table.name, **record}))
    for check in outcome.checks:
        print(_line({"type": "check", **check.record()}))


def _line(record: dict[str, str | int | float | bool | None]) -> str:
    return json.dumps(record, ensure_ascii=False, allow_nan=False)


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
        _save(draw(), path)
        yield path


def _save(figure: Figure, path: Path) -> None:
    """As a PNG file with a palette, a third of the size."""
    from PIL import Image

    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=DOTS_PER_INCH)
    with Image.open(drawn) as image:
        image.convert("RGB").quantize(COLOURS).save(path, optimize=True)
