"""Processes that a measurement starts together, and ends together whatever happens."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from lsu_mesh_services.benchmarks.checkout import environment_of

LAST_LINES = 8
END_S = 8.0
"""How long processes may take to end when asked; a recorder writes its file then."""


class DidNotRun(Exception):
    """Processes did not start, or ended too early; the message holds their last lines."""


class ProcessGroup:
    """Python programs as children of this process; a context manager.

    Parameters
    ----------
    tree:
        Folder of a checkout whose packages the programs import, ``None`` for those of this process.
    """

    def __init__(self, tree: Path | None = None) -> None:
        self._environment = {**environment_of(tree), "LSU_MESH_PARENT": str(os.getpid())}
        self._children: dict[str, subprocess.Popen[str]] = {}
        self._output: dict[str, IO[str]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()

    def start(self, label: str, arguments: Sequence[str], *, held: bool = False) -> None:
        """Start ``python -P ARGUMENTS``; a held process waits for :meth:`tell`."""
        output = self._output[label] = tempfile.TemporaryFile("w+", errors="replace")  # noqa: SIM115 - end() closes it
        self._children[label] = subprocess.Popen(
            [sys.executable, "-P", *arguments],
            stdin=subprocess.PIPE if held else subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            text=True,
            env=self._environment,
            start_new_session=True,  # Ctrl-C at the terminal ends the measurement, which ends them in turn
        )

    def tell(self, label: str, line: str) -> None:
        """Write a line to a held process."""
        stream = self._children[label].stdin
        assert stream is not None
        stream.write(f"{line}\n")
        stream.close()

    @property
    def pids(self) -> dict[str, int]:
        """Process number by label."""
        return {label: child.pid for label, child in self._children.items()}

    def check(self) -> None:
        """Raise :class:`DidNotRun` when one has ended."""
        for label, child in self._children.items():
            if child.poll() is not None:
                raise DidNotRun(f"{label} ended with exit code {child.returncode}\n{self._last_lines(label)}")

    def words(self) -> str:
        """The last lines of every process that wrote some."""
        said = {label: self._last_lines(label) for label in self._children}
        return "\n".join(f"{label}:\n{lines}" for label, lines in said.items() if lines)

    def _last_lines(self, label: str) -> str:
        output = self._output[label]
        output.seek(0)
        return "".join(f"    {line}" for line in output.readlines()[-LAST_LINES:]).rstrip("\n")

    def end(self) -> None:
        """Ask all of them to end, and kill those that do not."""
        for child in self._children.values():
            if child.poll() is None:
                child.terminate()
            if child.stdin is not None and not child.stdin.closed:
                child.stdin.close()  # one that waits for its line goes on, and ends
        limit = time.monotonic() + END_S
        for child in self._children.values():
            try:
                child.wait(timeout=max(0.1, limit - time.monotonic()))
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
        for output in self._output.values():
            output.close()
        self._children.clear()
        self._output.clear()
