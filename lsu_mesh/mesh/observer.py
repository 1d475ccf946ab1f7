"""The level of a whole mesh, from its health messages: the worst level counts, and a silent peer is stale.

A peer says OK, WARN or ERROR of itself. STALE is what others say of it: its heartbeats have stopped, or it never came.
A heartbeat proves that a peer computes; liveliness proves only that its process is connected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.duplicate_process import WORDS
from lsu_mesh.mesh.messages import Health
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.processes import Process, Processes, process_of, words_of

Level = Literal["OK", "WARN", "ERROR", "STALE"]
LEVELS: tuple[Level, ...] = ("OK", "WARN", "ERROR", "STALE")
"""From best to worst."""
NO_WORD = "external, and tells no health: whether its data come stands in the health of those who use them"
STALE_NS = 3 * SECOND
"""A peer that has sent no heartbeat for so long, three times its period, is stale."""


@dataclass(frozen=True)
class PeerHealth:
    """How one peer does."""

    name: str
    role: str
    level: Level
    reasons: tuple[str, ...] = ()
    step: int = 0
    age_ns: int | None = None
    """Since the last heartbeat; None where none ever came."""
    counters: Mapping[str, float] = field(default_factory=dict)
    started_ns: int | None = None
    """When its process started, by its own clock; None where it does not say."""
    host: str | None = None
    """Machine that it runs on; None where it does not say."""
    processes: tuple[Process, ...] = ()
    """All that run under the name now; more than one is a mistake."""


@dataclass
class _Heard:
    message: Health
    at: int


class HealthObserver:
    """Collects heartbeats and liveliness; :meth:`peers` judges at a time of the observer's own clock.

    Parameters
    ----------
    configuration:
        Its peers are expected; others that publish health are listed too.
    now:
        When the observer begins to listen; a peer without a heartbeat in the next ``STALE_NS`` is stale.
    """

    def __init__(self, configuration: Configuration, now: int) -> None:
        self._roles = {name: role for role, name in configuration.peers()}
        self._external = {name for role, name in configuration.peers() if configuration.is_external(role, name)}
        self._began = now
        self._received_at: dict[str, _Heard] = {}
        self._processes = Processes()
        self._gone: set[str] = set()

    def record(self, message: Health, now: int) -> None:
        """A heartbeat; one of an earlier life that comes late does not count."""
        self._processes.record(message, now)
        known = self._received_at.get(message.name)
        if known is not None:
            before = known.message
            is_older = message.seq <= before.seq if message.boot == before.boot else message.sent_ns < before.sent_ns
            if is_older:
                return
        self._received_at[message.name] = _Heard(message, now)

    def record_presence(self, name: str, is_there: bool) -> None:
        """Liveliness of a peer."""
        if is_there:
            self._gone.discard(name)
        else:
            self._gone.add(name)

    def peers(self, now: int) -> list[PeerHealth]:
        """Every peer, in the configuration's order, then others by name."""
        names = [*self._roles, *sorted(set(self._received_at) - set(self._roles))]
        return [self._judged(name, now) for name in names]

    def level(self, now: int) -> Level:
        """The worst level of all peers."""
        return worst([peer.level for peer in self.peers(now)])

    def _judged(self, name: str, now: int) -> PeerHealth:
        heard = self._received_at.get(name)
        if heard is None and name in self._external and name not in self._gone:
            return PeerHealth(name, self._roles[name], "OK", (NO_WORD,))
        if heard is None:
            waited = now - self._began
            is_late = waited >= STALE_NS or name in self._gone
            reason = f"no heartbeat in {waited / SECOND:.1f} s" if name not in self._gone else "left the mesh"
            return PeerHealth(name, self._roles[name], "STALE" if is_late else "WARN", (reason,))
        message, age = heard.message, now - heard.at
        living = self._processes.newest(name, now)
        level, reasons = _told_by(living if len(living) > 1 else [message])
        if name in self._gone:
            level, reasons = "STALE", ("left the mesh", *reasons)
        elif age >= STALE_NS:
            level, reasons = "STALE", (f"no heartbeat for {age / SECOND:.1f} s", *reasons)
        return PeerHealth(
            name=name,
            role=message.role,
            level=level,
            reasons=reasons,
            step=message.step,
            age_ns=age,
            counters=message.counters,
            started_ns=message.started_ns,
            host=message.host,
            processes=tuple(process_of(one) for one in living),
        )


def _told_by(messages: Sequence[Health]) -> tuple[Level, tuple[str, ...]]:
    """The worst level of a peer's processes and all that they say, each thing once."""
    reasons = dict.fromkeys(reason for message in messages for reason in message.reasons)
    levels: list[Level] = [message.level for message in messages]
    if len(messages) == 1:
        return levels[0], tuple(reasons)
    words = f"{words_of([process_of(message) for message in messages])}; stop all but one"
    return worst([*levels, "WARN"]), (words, *(reason for reason in reasons if not reason.startswith(WORDS)))


def worst(levels: Sequence[Level]) -> Level:
    """The worst of some levels; OK of none."""
    return max(levels, key=LEVELS.index, default="OK")
