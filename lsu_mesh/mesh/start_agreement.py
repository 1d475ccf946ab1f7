"""How the peers of a mesh with ``start_time = "now"`` agree on t_0: a pure state machine, like a node.

The first estimator by role and name, fusion before filters, decides when it stands and has heard of no other start for
``PATIENCE_NS``. All others ask the ``model`` query, which estimators answer with their start, and wait. Of two starts
that meet, the earlier stands; who has the later one begins again.
"""

from __future__ import annotations

import msgspec
from msgspec import Struct

from lsu_mesh.mesh.config.settings import Configuration

SECOND = 1_000_000_000
PATIENCE_NS = 2 * SECOND
ASK_NS, ASK_AGAIN_NS = SECOND // 2, 5 * SECOND
"""Between two questions, before the start is known and after."""


class _Start(Struct):
    """What is read of an answer."""

    start_ns: int | None = None


class StartAgreement:
    """The start of one peer.

    Parameters
    ----------
    configuration:
        The mesh, with ``start_time = "now"``.
    role, name:
        The peer.
    now:
        When it stands, in nanoseconds since 1970.
    start_ns:
        The start that it has already agreed to; None: none.
    """

    def __init__(
        self, configuration: Configuration, role: str, name: str, now: int, start_ns: int | None = None
    ) -> None:
        self.start_ns = start_ns
        self.decider = decider(configuration)
        self._decides = self.decider == (role, name)
        self._stands_since = now
        self._ask_at = now

    def questions(self, now: int) -> bool:
        """Whether to ask the ``model`` query now; counts as asked."""
        if now < self._ask_at:
            return False
        self._ask_at = now + (ASK_NS if self.start_ns is None else ASK_AGAIN_NS)
        return True

    def ask_soon(self, now: int) -> None:
        """Somebody has come, who may have another start."""
        self._ask_at = min(self._ask_at, now + ASK_NS)

    def receive(self, answer: bytes) -> bool:
        """An answer of the ``model`` query; whether it gives this peer another start than it had."""
        try:
            start_ns = msgspec.msgpack.decode(answer, type=_Start).start_ns
        except msgspec.MsgspecError:
            return False
        if start_ns is None or start_ns < 0 or (self.start_ns is not None and self.start_ns <= start_ns):
            return False
        self.start_ns = start_ns
        return True

    def tick(self, now: int) -> bool:
        """Decide, if it is due; whether it was."""
        if self.start_ns is not None or not self._decides or now - self._stands_since < PATIENCE_NS:
            return False
        self.start_ns = now
        return True

    def waiting_for(self) -> str:
        """In words, what a peer without a start waits for."""
        if self.decider is None:
            return "the start of the mesh, which no filter or fusion is there to decide"
        role, name = self.decider
        own = " (this process)" if self._decides else ""
        return f"the start of the mesh, which {role} {name} decides{own}"


def decider(configuration: Configuration) -> tuple[str, str] | None:
    """Role and name of the first estimator: the first fusion, else the first filter."""
    for role, names in (("fusion", configuration.fusion), ("filter", configuration.filters)):
        if names:
            return role, min(names)
    return None
