"""Waiting for Rerun no longer than one wants to.

Its ``flush`` can hang for ever once its file writer has ended (a full disk), whatever time limit it is given.
"""

from __future__ import annotations

import threading
from collections.abc import Callable


def ends_within(seconds: float, work: Callable[[], None]) -> bool:
    """Do the work in a thread of its own; whether it has ended in time. Raises what the work raises.

    Work that does not end is left behind; its thread keeps no process alive.
    """
    errors: list[BaseException] = []

    def run() -> None:
        try:
            work()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(seconds)
    if errors:
        raise errors[0]
    return not thread.is_alive()
