"""Viewers that follow a run: the native one, or the web viewer on the loopback. The mesh does without them."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from lsu_mesh_services.recording.rerun_programs import quiet_environment

LOOPBACK = "127.0.0.1"


def free_port() -> int:
    """A port of the loopback interface that nobody listens on now."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


@dataclass
class Viewer:
    """A program that shows what the recorder sends on ``port`` of the loopback."""

    port: int
    is_web: bool
    web_port: int
    process: subprocess.Popen[bytes] | None = None
    is_told: bool = False

    def open(self) -> str:
        """Start it; words for people."""
        address = f"rerun+http://{LOOPBACK}:{self.port}/proxy"
        program = str(Path(sys.executable).with_name("rerun"))
        command = [program, "--hide-welcome-screen", "--bind", LOOPBACK]
        if self.is_web:
            command += ["--serve-web", "--web-viewer-port", str(self.web_port), address]
        else:
            command += ["--port", "auto", "--connect", address]
        try:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=quiet_environment(),
                start_new_session=True,  # Ctrl-C ends the run, not the viewer
            )
        except OSError as error:
            self.is_told = True
            return f"no viewer: {program}: {error.strerror}; the run continues without it"
        return f"viewer: http://{LOOPBACK}:{self.web_port}/?url={address}" if self.is_web else "viewer: opening"

    def end_words(self) -> str:
        """What to say once when the viewer is gone; "" as long as it is there."""
        if self.is_told or self.process is None or self.process.poll() is None:
            return ""
        self.is_told = True
        if self.process.returncode == 0:
            return "the viewer was closed; the run continues"
        hint = "no display? --web serves it to a browser" if not self.is_web else f"is port {self.web_port} taken?"
        return f"the viewer ended with exit code {self.process.returncode} ({hint}); the run continues"

    def close(self) -> None:
        """End the web viewer with the run; a native one stays for the person who looks at it."""
        if self.is_web and self.process is not None and self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGTERM)  # the program is a child of Rerun's script of that name
            try:
                self.process.wait(timeout=3.0)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()
