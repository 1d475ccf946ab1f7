"""Real processes on free ports."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import pytest
from ports import free_port


@dataclass
class Session:
    """A started command and what it wrote."""

    process: subprocess.Popen[str]
    endpoint: str
    folder: Path
    output: tuple[str, str] = ("", "")
    lines: list[dict[str, Any]] = field(default_factory=list)

    def children(self) -> list[psutil.Process]:
        """Processes that the command has started and that run."""
        try:
            return psutil.Process(self.process.pid).children(recursive=True)
        except psutil.NoSuchProcess:
            return []

    def child(self, words: str, timeout: float = 60.0) -> psutil.Process:
        """The child whose command line holds ``words``, as soon as it is there."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            for child in self.children():
                with contextlib.suppress(psutil.NoSuchProcess):  # a zombie has no command line
                    if words in " ".join(child.cmdline()):
                        return child
            time.sleep(0.02)
        raise AssertionError(f"no child {words!r} within {timeout} s")

    def wait(self, timeout: float = 90.0) -> int:
        """The exit code; reads the output."""
        self.output = self.process.communicate(timeout=timeout)
        self.lines = [json.loads(line) for line in self.output[0].splitlines() if line.startswith("{")]
        return self.process.returncode

    def of(self, kind: str) -> list[dict[str, Any]]:
        """JSON lines of a type."""
        return [line for line in self.lines if line["type"] == kind]


Start = Callable[..., Session]


@pytest.fixture
def start(lsu_mesh_command: list[str], root: Path, tmp_path: Path) -> Iterator[Start]:
    """Start ``lsu-mesh`` with arguments; ``{endpoint}`` in them is a free port. Nothing outlives the test.

    ``paths`` come before the checkout where Python looks for modules; ``command`` is another way to start it.
    """
    started: list[Session] = []

    def begin(*arguments: str, endpoint: str = "", paths: Sequence[str] = (), command: Sequence[str] = ()) -> Session:
        endpoint = endpoint or f"tcp/127.0.0.1:{free_port()}"
        words = [*(command or lsu_mesh_command), *(argument.replace("{endpoint}", endpoint) for argument in arguments)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*paths, str(root), str(root / "services")])}
        process = subprocess.Popen(
            words, cwd=tmp_path, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        session = Session(process, endpoint, tmp_path)
        started.append(session)
        return session

    yield begin
    for session in started:
        for process in [*session.children(), *([session.process] if session.process.poll() is None else [])]:
            process.kill()
        session.process.communicate()


ON_PORT = ("-X", "network.entry={endpoint}")


@pytest.fixture
def start_run(start: Start) -> Start:
    """Start ``lsu-mesh run --json`` on a free port."""

    def begin(*arguments: str) -> Session:
        return start("run", "--json", *arguments, *ON_PORT)

    return begin
