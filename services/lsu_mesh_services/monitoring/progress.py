"""Bars of progress on a terminal; nothing elsewhere."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Self


class ShareDone:
    """How much of a job is done, and the time that is left. Without rich, or where stderr is no terminal: nothing."""

    def __init__(self, words: str) -> None:
        self._bar: Any = None
        try:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
        except ImportError:
            return
        console = Console(stderr=True)
        if not console.is_terminal:
            return
        columns = (
            TextColumn(words),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            TextColumn("left"),
        )
        self._bar = Progress(*columns, console=console, transient=True)
        self._task = self._bar.add_task(words, total=1.0)

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, share: float) -> None:
        """The share that is done, from 0 to 1."""
        if self._bar is not None:
            self._bar.update(self._task, completed=share)
