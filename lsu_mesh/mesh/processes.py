"""Which processes run under the name of one peer, told from the health messages of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from lsu_mesh.mesh.messages import Health

SECOND = 1_000_000_000
HEARD_NS = 3 * SECOND
"""A process that has sent no health for so long, three times its period, is gone."""
MAX_PROCESSES = 8
"""Of one name."""


@dataclass(frozen=True)
class Process:
    """A process, and what it tells of itself."""

    boot: str
    host: str | None
    started_ns: int | None

    @property
    def words(self) -> str:
        """Where it runs and since when."""
        host = f"on {self.host}" if self.host else "on an unknown host"
        return host if self.started_ns is None else f"{host} since {clock_time(self.started_ns)}"


def clock_time(at_ns: int) -> str:
    """A time as people write it; the date is left out, the zone is not."""
    return f"{datetime.fromtimestamp(at_ns // SECOND, UTC):%H:%M:%S} UTC"


def process_of(message: Health) -> Process:
    """The process that sent a health message."""
    return Process(message.boot, message.host, message.started_ns)


def words_of(processes: Sequence[Process]) -> str:
    """For people: how many processes there are, and where."""
    return f"{len(processes)} processes: {'; '.join(one.words for one in processes)}"


@dataclass
class _Heard:
    process: Process
    newest: Health
    first_at: int
    at: int


class Processes:
    """The living processes of each name.

    A process that was restarted is one: the old one counts beside the new one only after it has been heard again.
    """

    def __init__(self) -> None:
        self._heard: dict[str, dict[str, _Heard]] = {}

    def record(self, message: Health, now: int) -> None:
        """A health message of any process has come."""
        of_name = self._heard.setdefault(message.name, {})
        known = of_name.get(message.boot)
        if known is None:
            for boot in [one.process.boot for one in of_name.values() if now - one.at >= HEARD_NS]:
                del of_name[boot]
            if len(of_name) >= MAX_PROCESSES:
                del of_name[min(of_name, key=lambda boot: of_name[boot].at)]
            of_name[message.boot] = _Heard(process_of(message), message, now, now)
        elif message.seq > known.newest.seq:
            known.newest, known.at = message, now

    def newest(self, name: str, now: int) -> list[Health]:
        """The newest message of each living process of a name, those that were heard first, first."""
        recent = [one for one in self._heard.get(name, {}).values() if now - one.at < HEARD_NS]
        lives = [one for i, one in enumerate(recent) if all(one.at > later.first_at for later in recent[i + 1 :])]
        return [one.newest for one in lives]

    def of(self, name: str, now: int) -> list[Process]:
        """The living processes of a name."""
        return [process_of(message) for message in self.newest(name, now)]
