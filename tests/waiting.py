"""Waiting for what another process or thread does."""

from __future__ import annotations

import time
from collections.abc import Callable

WITHIN = 30.0
"""Seconds that a loaded machine may take."""


def until(met: Callable[[], object], what: str, timeout: float = WITHIN, pause: float = 0.01) -> None:
    """Wait for a condition; ``what`` is told where it does not come true."""
    end = time.monotonic() + timeout
    while not met():
        assert time.monotonic() < end, f"{what}: not within {timeout:g} s"
        time.sleep(pause)
