"""The process that the peers of ``lsu-mesh run`` are forked from: imports and kernels are loaded once for all of them.

Nothing that starts threads is imported before a fork: neither zenoh nor rerun. Plants, sensors and the recorder are
forked first, without numba; before the first estimator the kernels of the filters of its configuration are loaded, and
compiled where the cache lacks them.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import select
import signal
import socket
import sys
import threading
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

# what peers need besides the session; kernels load numba when they are first called
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode
from lsu_mesh.mesh.nodes.plant import PlantNode  # noqa: F401
from lsu_mesh.mesh.nodes.sensor import SimulatedSensorNode  # noqa: F401
from lsu_mesh_services.cli import build_parser, main
from lsu_mesh_services.configuration import DEMO, flags
from lsu_mesh_services.exit_codes import FAILURE
from lsu_mesh_services.forking import MAX_PACKET

ESTIMATING = ("filter", "fusion")


class Server:
    """Forks what it is asked for, and says how it ended; it ends when who asked is gone."""

    def __init__(self, requests: socket.socket) -> None:
        self._requests = requests
        self._numbers: dict[int, int] = {}
        """Number of the request, by process id of each child that runs."""
        self._is_prepared = False
        self._woken, self._wakes = os.pipe()
        for end in (self._woken, self._wakes):
            os.set_blocking(end, False)
        signal.signal(signal.SIGCHLD, lambda number, frame: None)
        signal.set_wakeup_fd(self._wakes, warn_on_full_buffer=False)

    def serve(self) -> None:
        """Until the other end of the socket is closed."""
        while True:
            waiting: list[Any] = [self._requests, self._woken]
            ready = select.select(waiting, [], [])[0]
            if self._woken in ready:
                with contextlib.suppress(BlockingIOError):
                    os.read(self._woken, 4096)
            self._tell_ended()
            if self._requests in ready and not self._take():
                return

    def _take(self) -> bool:
        packet, ends, _, _ = socket.recv_fds(self._requests, MAX_PACKET, 2)
        if not packet:
            return False
        request = json.loads(packet)
        if "signal" in request:
            running = [pid for pid, number in self._numbers.items() if number == request["signal"]]
            for pid in running:
                os.kill(pid, request["code"])
            return True
        arguments = request["arguments"]
        if not self._is_prepared and arguments[0] in ESTIMATING:
            self._is_prepared = True
            _load_kernels(arguments)
        self._fork(request, ends)
        for end in ends:
            os.close(end)
        return True

    def _fork(self, request: dict[str, Any], ends: list[int]) -> None:
        if threading.active_count() > 1:  # by the module of a filter that is none of ours
            self._tell({"fork": request["fork"], "refused": 1})
            return
        parent = os.getpid()
        pid = os.fork()
        if pid == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            for own in (self._woken, self._wakes, self._requests.detach()):
                os.close(own)
            environment = {**request["environment"], "LSU_MESH_PARENT": str(parent)}
            _become(request["arguments"], environment, stdin=ends[0], stdout=ends[1])
        self._numbers[pid] = request["fork"]
        self._tell({"fork": request["fork"], "pid": pid})

    def _tell_ended(self) -> None:
        while self._numbers:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                return
            if pid in self._numbers:
                self._tell({"fork": self._numbers.pop(pid), "ended": os.waitstatus_to_exitcode(status)})

    def _tell(self, what: dict[str, int]) -> None:
        with contextlib.suppress(OSError):  # who asked is gone, which serve() sees
            self._requests.send(json.dumps(what).encode())


def _become(arguments: Sequence[str], environment: dict[str, str], *, stdin: int, stdout: int) -> NoReturn:
    """Run a command of ``lsu-mesh`` in this forked process, as if it had been started."""
    code = FAILURE
    try:
        os.setsid()
        for source, target in ((stdin, 0), (stdout, 1), (stdout, 2)):
            os.dup2(source, target)
        for end in (stdin, stdout):
            os.close(end)
        os.environ.update(environment)
        _show_command([sys.executable, "-P", "-m", "lsu_mesh_services", *arguments])
        code = main(arguments)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else FAILURE
    except BaseException:  # nothing may go up into the server's loop
        traceback.print_exc()
    finally:
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _show_command(command: Sequence[str]) -> None:
    """Write the command line over that of the server, where ``ps`` reads it, as far as there is room."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        fields = Path("/proc/self/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        start, end = int(fields[45]), int(fields[46])  # arg_start and arg_end of proc(5)
        room = end - start
        if start and room > 1:
            line = b"".join(part.encode() + b"\0" for part in command)[: room - 1]
            ctypes.memmove(start, line.ljust(room, b"\0"), room)


def _load_kernels(arguments: Sequence[str]) -> None:
    """Make each filter and fusion of the configuration once and warm it up; what fails here fails again in its peer."""
    with contextlib.suppress(Exception, SystemExit):
        options = build_parser().parse_args(arguments)
        path = DEMO if options.config is None else Path(options.config)
        configuration = load(path, [*flags(options), *options.overrides], os.environ, makes_filters=False)
        _compile_what_is_missing()
        _warm_up(configuration)
    gc.collect()
    gc.freeze()  # collections in the children leave the shared memory as it is


def _compile_what_is_missing() -> None:
    from lsu_mesh.filters.warm_up import warm_up
    from lsu_mesh.kernels import filter_step
    from lsu_mesh.kernels.linear_programs import safe_maxima
    from lsu_mesh.kernels.runtime.compile import awaits_compilation

    if awaits_compilation(filter_step.advance) or awaits_compilation(safe_maxima.maxima):
        warm_up()


def _warm_up(configuration: Configuration) -> None:
    from lsu_mesh.filters.registry import FILTERS

    own = [name for name, filter_ in configuration.filters.items() if filter_.kind in FILTERS]
    for node in (FilterNode, FusionNode):
        for name in own if node is FilterNode else configuration.fusion:
            with contextlib.suppress(Exception):
                node(configuration, name, "0" * 16).warm_up()


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as requests:
        Server(requests).serve()
