"""How long collections of garbage take, so that a test can leave them out of what it measures."""

from __future__ import annotations

import gc
import time


class Collections:
    """Processor time that garbage collections have taken so far: they are the whole process's, not one message's."""

    def __init__(self) -> None:
        self.took_ns = self._began = 0
        gc.callbacks.append(self._record)

    def _record(self, phase: str, about: dict[str, int]) -> None:
        if phase == "start":
            self._began = time.thread_time_ns()
        else:
            self.took_ns += time.thread_time_ns() - self._began

    def end(self) -> None:
        gc.callbacks.remove(self._record)
