"""Starts, watches, restarts and stops its own children, and keeps the last lines that they print."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from lsu_mesh.mesh.config.settings import SupervisorSettings
from lsu_mesh_services.forking import CAN_FORK, ForkedProcess, ForkServer

PROGRAM = (sys.executable, "-P", "-m", "lsu_mesh_services")
"""``lsu-mesh``; -P: not the packages of the working folder."""
LAST_WORDS = 12
STOP_ORDER = ("plant", "sensor", "identifier", "filter", "fusion", "recorder")
PATIENCE_S = {"recorder": 20.0}
"""Seconds from SIGTERM to SIGKILL, 4 unless the role needs longer to write its file."""


@dataclass
class Child:
    """One process of the mesh."""

    role: str
    name: str
    arguments: Sequence[str]
    process: subprocess.Popen[str] | ForkedProcess | None = None
    restarts: int = 0
    restart_at: float | None = None
    given_up: bool = False
    is_held: bool = False
    """Whether the process waits for a line on its standard input before it begins."""
    words: deque[str] = field(default_factory=lambda: deque(maxlen=LAST_WORDS))
    line: str = ""
    reader: threading.Thread | None = None

    @property
    def label(self) -> str:
        """``role name``."""
        return f"{self.role} {self.name}" if self.role != self.name else self.role

    def last_words(self) -> str:
        """The last lines that the process wrote."""
        return "\n".join(f"    {line}" for line in self.words)


class Supervisor:
    """Runs children; nothing else on the machine is ever touched.

    With ``forks`` they are forked from a process that has loaded what they need, where the system allows that.
    """

    def __init__(
        self, settings: SupervisorSettings, environment: Mapping[str, str] | None = None, *, forks: bool = False
    ) -> None:
        self._settings = settings
        self._environment = {**os.environ, **(environment or {}), "LSU_MESH_PARENT": str(os.getpid())}
        self._server = ForkServer(self._environment) if forks and CAN_FORK else None
        self.children: list[Child] = []

    def start(self, role: str, name: str, arguments: Sequence[str], *, held: bool = False) -> Child:
        """Start ``lsu-mesh ROLE NAME …`` in a process of its own; a held one waits for :meth:`tell`."""
        child = Child(role, name, [*PROGRAM, role, name, *arguments], is_held=held)
        self.children.append(child)
        self._launch(child)
        return child

    def _launch(self, child: Child, *, forks: bool = True) -> None:
        environment = {"LSU_MESH_RESTARTS": str(child.restarts)}
        if forks and self._server is not None and self._server.is_alive:
            arguments = child.arguments[len(PROGRAM) :]
            child.process = self._server.fork(arguments, environment, has_input=child.is_held)
        else:
            child.process = self._start_program(child, environment)
        child.reader = threading.Thread(target=_read_words, args=(child.process, child.words), daemon=True)
        child.reader.start()
        if child.is_held and child.line:
            self.tell(child, child.line)

    def _start_program(self, child: Child, environment: Mapping[str, str]) -> subprocess.Popen[str]:
        return subprocess.Popen(
            child.arguments,
            stdin=subprocess.PIPE if child.is_held else subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env={**self._environment, **environment},
            start_new_session=True,  # Ctrl-C at the terminal reaches the supervisor only, which stops them in order
        )

    def tell(self, child: Child, line: str) -> None:
        """Write a line to a held child; when it is started again it finds the line at once."""
        child.line = line
        if child.process is not None and child.process.stdin is not None:
            try:
                child.process.stdin.write(f"{line}\n")
                child.process.stdin.close()
            except BrokenPipeError:
                return  # it has died; watch() sees that

    def watch(self, now: float) -> list[tuple[Child, str]]:
        """Look after the children once; returns what happened, in words."""
        happened = []
        for child in self.children:
            if child.restart_at is not None:
                if now >= child.restart_at:
                    child.restart_at = None
                    child.restarts += 1
                    self._launch(child)
                    happened.append((child, f"{child.label} was started again"))
            elif isinstance(child.process, ForkedProcess) and child.process.was_refused():
                self._launch(child, forks=False)
            elif child.process is not None and child.process.poll() is not None and not child.given_up:
                happened.append((child, self._ended(child, now)))
        return happened

    def _ended(self, child: Child, now: float) -> str:
        how = _ending(child)
        if self._settings.restart and child.restarts < self._settings.limit:
            child.restart_at = now + self._settings.backoff * 2**child.restarts
            return f"{child.label} ended ({how})"
        child.given_up = True
        why = f"after {child.restarts} restarts" if self._settings.restart else "supervisor.restart is false"
        return f"{child.label} ended ({how}) and is not started again: {why}"

    def stop(self) -> list[str]:
        """Stop all children, sources first and the recorder last; returns complaints."""
        complaints = []
        for role in STOP_ORDER:
            group = [child for child in self.children if child.role == role and _is_running(child)]
            for child in group:
                assert child.process is not None
                child.process.send_signal(signal.SIGTERM)
            end = time.monotonic() + PATIENCE_S.get(role, 4.0)
            complaints += [words for child in group if (words := _await_end(child, end))]
        return complaints

    def kill(self) -> None:
        """Kill what still runs, at once."""
        for child in self.children:
            if _is_running(child):
                assert child.process is not None
                child.process.kill()
                child.process.wait()
        if self._server is not None:
            self._server.close()


def _is_running(child: Child) -> bool:
    return child.process is not None and child.process.poll() is None


def _await_end(child: Child, end: float) -> str:
    assert child.process is not None
    try:
        child.process.wait(timeout=max(0.1, end - time.monotonic()))
    except subprocess.TimeoutExpired:
        child.process.kill()
        child.process.wait()
        return f"{child.label} did not stop when asked and was killed"
    if child.process.returncode != 0:
        return f"{child.label} stopped with {_ending(child)}\n{child.last_words()}"
    return ""


def _ending(child: Child) -> str:
    assert child.process is not None
    code = child.process.returncode
    if code is not None and code < 0:
        return f"killed by {signal.Signals(-code).name}"
    return f"exit code {code}"


def _read_words(process: subprocess.Popen[str] | ForkedProcess, words: deque[str]) -> None:
    assert process.stdout is not None
    with process.stdout:
        for line in process.stdout:
            words.append(line.rstrip())
