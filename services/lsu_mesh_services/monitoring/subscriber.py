"""One more subscriber of a running mesh, for the tools that look at it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

from lsu_mesh.mesh.access import recorded_topics
from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import key, parse
from lsu_mesh.mesh.messages import Message
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh_services.bus import Bus, Clock
from lsu_mesh_services.configuration import load_or_explain
from lsu_mesh_services.exit_codes import NOT_MET, USAGE
from lsu_mesh_services.mesh_start import find_start
from lsu_mesh_services.network.addresses import Addresses, WrongAddress
from lsu_mesh_services.session import connection_report, session_settings, with_session
from lsu_mesh_services.stop import Stop

LINK_S = 3.0
"""How long a tool looks for a peer of the mesh."""


class NobodyThere(Exception):
    """No peer or router could be reached; the text says where it was looked for."""


class Heard(NamedTuple):
    """A message, or the presence of a peer (``message`` None, ``is_there`` set)."""

    topic: str
    name: str
    arrival_ns: int
    size: int
    message: Message | None
    is_there: bool = False


class Watch:
    """Hears what is published from now on, and who is there."""

    def __init__(self, configuration: Configuration, bus: Bus, clock: Clock, stop: Stop | None) -> None:
        self.clock = clock
        endless = replace(configuration, mesh=replace(configuration.mesh, steps=None))
        self.admission = Admission(endless, recorded_topics(configuration))
        """Takes steps beyond the configuration's last: the mesh may have been started with another one."""
        self._mesh, self._bus, self._stop = configuration.mesh.name, bus, stop

    def listen(self, addresses: Addresses) -> None:
        """Hear these keys, and who comes and goes."""
        self._bus.watch_alive(key(self._mesh, "live", "*"))
        for topic, name in addresses:
            self._bus.subscribe_live(key(self._mesh, topic, name))

    def tell_refused(self) -> None:
        """On stderr, what came and is no message of this mesh: another model, another version, a stranger's."""
        refused = self.admission.refused.total()
        if refused:
            print(f"{refused} message(s) were refused, the last: {self.admission.last_refusal}", file=sys.stderr)

    def received(self, seconds: float | None = None) -> Iterator[Heard | None]:
        """What comes, until the time is over or the process is asked to stop; None now and then where nothing comes."""
        end = None if seconds is None else self.clock.now() + int(seconds * SECOND)
        while not self._stop:
            left = 0.1 if end is None else (end - self.clock.now()) / SECOND
            if left <= 0:
                return
            yield self._next(min(0.1, left))

    def _next(self, patience: float) -> Heard | None:
        arrival = self._bus.next(patience)
        address = None if arrival is None else parse(arrival.key)
        if arrival is None or address is None:
            return None
        topic, name, size = address.topic, address.name, len(arrival.payload)
        if arrival.what != "sample":
            return Heard(
                topic=topic,
                name=name,
                arrival_ns=arrival.arrival_ns,
                size=size,
                message=None,
                is_there=arrival.what == "alive",
            )
        message = self.admission.admit(arrival.key, arrival.payload)
        return (
            None
            if message is None
            else Heard(topic=topic, name=name, arrival_ns=arrival.arrival_ns, size=size, message=message)
        )


@contextmanager
def watching(configuration: Configuration, options: argparse.Namespace) -> Iterator[Watch]:
    """A session with the mesh of the configuration.

    Raises
    ------
    NobodyThere
        When no peer and no router answers.
    """
    clock, settings = Clock(), session_settings(configuration, options)
    stop: Stop | None = getattr(options, "stop", None)
    with Bus(settings, clock) as bus, connection_report(options.command, bus, settings, says_connected=False):
        end = clock.now() + int(LINK_S * SECOND)
        while not bus.links() and not stop:
            if clock.now() > end:
                where = ", ".join(settings.connect)
                raise NobodyThere(
                    f"no peer of mesh {configuration.mesh.name!r} answers at {where}; start it with `lsu-mesh run`, "
                    "or give its address with -e ENDPOINT"
                )
            bus.next(0.02)
        started = find_start(configuration, bus, clock, LINK_S)
        if started is None:
            raise NobodyThere(
                f"mesh {configuration.mesh.name!r} has not started yet: no filter or fusion tells its start; "
                "start it with `lsu-mesh run`"
            )
        yield Watch(started, bus, clock, stop)


def run_tool(options: argparse.Namespace, work: Callable[[Configuration, argparse.Namespace], int]) -> int:
    """Load the configuration, do the work, and turn what goes wrong into words and exit codes."""
    configuration = load_or_explain(options.config, options, makes_filters=False)
    if configuration is None:
        return USAGE
    try:
        return with_session(options.command, lambda: work(configuration, options))
    except WrongAddress as error:
        print(f"{configuration.path}: {error}", file=sys.stderr)
        return USAGE
    except NobodyThere as error:
        print(error, file=sys.stderr)
        return NOT_MET
