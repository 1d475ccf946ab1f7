"""When a process is asked to end. Light, so that it is in force before anything heavy is imported."""

from __future__ import annotations

import os
import signal
from types import FrameType


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
