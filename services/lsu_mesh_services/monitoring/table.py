"""The end of a run for people (a table) and for programs (JSON lines), and its progress."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Self

from lsu_mesh.mesh.messages import Event
from lsu_mesh_services.monitoring.run_report import Row

MAX_EVENTS = 8


class Progress:
    """A bar on a terminal, nothing elsewhere."""

    def __init__(self, last: int | None, *, shown: bool) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as Bar

        console = Console(stderr=True)
        columns = (TextColumn("step"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._bar = Bar(*columns, console=console, disable=not (shown and console.is_terminal))
        self._task = self._bar.add_task("step", total=last)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def show(self, step: int) -> None:
        """The newest step."""
        self._bar.update(self._task, completed=step)


def print_table(rows: Sequence[Row], happened: Sequence[str], events: Sequence[Event], opening: str) -> None:
    """One row per estimator on stdout, what happened below it, and how to open the recording."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 120, highlight=False)
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("")
    table.add_column("kind")
    titles = ("steps", "RMSE", "truth inside", "mean width", "latency p50", "p99", "gaps", "refused", "inconsistent")
    for title in titles:
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(row.name, row.kind, *_cells(row))
    console.print(table)
    for words in happened:
        console.print(words, markup=False)
    _print_events(console, events)
    if opening:
        console.print("\nopen the recording:", markup=False)
        console.print(f"  {opening}", markup=False, soft_wrap=True)


def _cells(row: Row) -> list[str]:
    return [
        str(row.steps),
        _shown(row.rmse, ".4f"),
        share(row.inside),
        _shown(row.width, ".4f"),
        _shown(row.latency_p50_ms, ".2f", " ms"),
        _shown(row.latency_p99_ms, ".2f", " ms"),
        str(row.gaps),
        str(row.refused),
        str(row.inconsistent),
    ]


def _shown(value: float | None, form: str, unit: str = "") -> str:
    return "–" if value is None else f"{value:{form}}{unit}"


def share(inside: float | None) -> str:
    """A share in percent, 100 % only where it is exactly that; words where there is no truth to hold."""
    if inside is None:
        return "no truth"
    return "100 %" if inside == 1.0 else f"{min(inside * 100, 99.99):.2f} %"


def _print_events(console: object, events: Sequence[Event]) -> None:
    from rich.console import Console

    assert isinstance(console, Console)
    told = [event for event in events if event.level != "INFO"]
    for event in told[:MAX_EVENTS]:
        console.print(f"{event.level} {event.src}: {event.text}", markup=False, soft_wrap=True)
    if len(told) > MAX_EVENTS:
        counts = Counter(f"{event.code} of {event.src}" for event in told)
        listed = ", ".join(f"{count} × {what}" for what, count in counts.most_common())
        console.print(f"{len(told)} events in all: {listed}", markup=False)


def print_json(rows: Sequence[Row], happened: Sequence[str], events: Sequence[Event], recording: Path | None) -> None:
    """One line per estimator, one per event, and a last one for the run."""
    for row in rows:
        print(json.dumps({"type": "estimator", **asdict(row)}))
    for event in events:
        about = {"level": event.level, "code": event.code, "text": event.text, "src": event.src, "about": event.about}
        print(json.dumps({"type": "event", **about}))
    print(
        json.dumps(
            {"type": "run", "recording": None if recording is None else str(recording), "happened": list(happened)}
        )
    )
