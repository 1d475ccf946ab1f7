"""Processes that are forked from one that has imported what they need: the side of who wants them.

The other side is ``services/lsu_mesh_services/fork_server.py``. They talk by JSON over a pair of sockets.
"""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from typing import IO

from lsu_mesh_services.exit_codes import FAILURE

CAN_FORK = sys.platform == "linux"
"""Elsewhere libraries of the system may not be used after a fork, and packets over sockets are missing."""
SERVER = "lsu_mesh_services.fork_server"
ROOM = "-" * 2000
"""Last argument of the server: where its children write their own command line, for ``ps``."""
MAX_PACKET = 1 << 17
PATIENCE_S = 2.0


class ForkServer:
    """The process that forks, and what it has said of its children."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", SERVER, str(theirs.fileno()), ROOM],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                env=dict(environment),
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
        self._forked: list[ForkedProcess] = []
        self.is_alive = True

    def fork(self, arguments: Sequence[str], environment: Mapping[str, str], *, has_input: bool) -> ForkedProcess:
        """``lsu-mesh ARGUMENTS`` with these further variables; it runs when the server comes to it."""
        number, own_ends = len(self._forked), []
        read_output, write_output = os.pipe()
        own_ends.append(write_output)
        write_input = -1
        if has_input:
            read_input, write_input = os.pipe()
        else:
            read_input = os.open(os.devnull, os.O_RDONLY)
        own_ends.append(read_input)
        stdin = os.fdopen(write_input, "w") if has_input else None
        process = ForkedProcess(self, number, stdin, os.fdopen(read_output, errors="replace"))
        self._forked.append(process)
        request = {"fork": number, "arguments": list(arguments), "environment": dict(environment)}
        try:
            socket.send_fds(self._requests, [json.dumps(request).encode()], [read_input, write_output])
        except OSError:
            self._lose()
        finally:
            for end in own_ends:
                os.close(end)
        return process

    def signal(self, number: int, code: int) -> None:
        """Have a child signalled by its parent, which knows whether it still is its child."""
        try:
            self._requests.send(json.dumps({"signal": number, "code": code}).encode())
        except OSError:
            self._lose()

    def take(self, timeout: float = 0.0) -> None:
        """Hear what the server says of its children, waiting for it so many seconds at most."""
        while self.is_alive and select.select([self._requests], [], [], timeout)[0]:
            timeout = 0.0
            try:
                packet = self._requests.recv(MAX_PACKET)
            except OSError:
                packet = b""
            if not packet:
                self._lose()
                return
            said = json.loads(packet)
            process = self._forked[said["fork"]]
            process.pid = said.get("pid", process.pid)
            process.returncode = said.get("ended")
            process.is_refused = "refused" in said

    def _lose(self) -> None:
        """The server is gone; its children see that and end, but nobody can tell how."""
        self.is_alive = False
        for process in self._forked:
            if process.returncode is None:
                process.returncode = FAILURE

    def kill(self) -> None:
        """End the server and what it compiles with at once; children of it that still run stop on their own."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._lose()

    def close(self) -> None:
        """End the server in order."""
        self._requests.close()
        self.is_alive = False
        try:
            self._process.wait(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.kill()


class ForkedProcess:
    """A process of a fork server; what a supervisor needs of ``subprocess.Popen``."""

    def __init__(self, server: ForkServer, number: int, stdin: IO[str] | None, stdout: IO[str]) -> None:
        self._server, self._number = server, number
        self.stdin, self.stdout = stdin, stdout
        self.pid: int | None = None
        """Known when the server has forked it."""
        self.returncode: int | None = None
        self.is_refused = False

    def was_refused(self) -> bool:
        """Whether the server could not fork, because something in it has started a thread."""
        self._server.take()
        return self.is_refused

    def poll(self) -> int | None:
        """The exit code, minus the number of the signal that killed it; None while it runs."""
        self._server.take()
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; raises ``subprocess.TimeoutExpired``."""
        end = None if timeout is None else time.monotonic() + timeout
        while self.poll() is None:
            left = 1.0 if end is None else end - time.monotonic()
            if left <= 0.0:
                raise subprocess.TimeoutExpired(SERVER, timeout or 0.0)
            self._server.take(min(left, 1.0))
        assert self.returncode is not None
        return self.returncode

    def send_signal(self, code: int) -> None:
        """Signal it, if it still runs."""
        self._server.signal(self._number, code)

    def kill(self) -> None:
        """Kill it; one that the server has not come to yet never runs."""
        self._server.take()
        if self.pid is None and self.returncode is None:
            self._server.kill()
        else:
            self.send_signal(signal.SIGKILL)
