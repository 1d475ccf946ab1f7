"""When a process is asked to end, and how it ends. Light: in force before anything heavy is imported."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import NoReturn


class Stop:
    """Set by the first SIGINT or SIGTERM; the second SIGINT ends the process at once with code 130."""

    def __init__(self) -> None:
        self.is_set = False
        self._interrupts = 0
        self._parent = int(os.environ.get("LSU_MESH_PARENT", "0"))
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._handle)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.is_set = True
        if number == signal.SIGINT:
            self._interrupts += 1
            if self._interrupts > 1:
                os._exit(130)

    def is_orphan(self) -> bool:
        """Whether the supervisor that started this process is gone."""
        return self._parent != 0 and os.getppid() != self._parent

    def __bool__(self) -> bool:
        return self.is_set or self.is_orphan()


def leave(code: int) -> NoReturn:
    """End the process now that its work is done and its session closed.

    Zenoh's threads would hold the end of the interpreter for another second.
    """
    if "zenoh" not in sys.modules:
        sys.exit(code)
    try:
        for stream in (sys.stdout, sys.stderr):
            if not stream.closed:
                stream.flush()
    except OSError:  # nobody reads any more
        code = code or 1
    os._exit(code)
