"""The start of a mesh with ``start_time = "now"``: a process waits for it, asks for it, or takes part in the choice."""

from __future__ import annotations

import sys
from collections.abc import Callable
from datetime import UTC, datetime

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import key, model_key
from lsu_mesh.mesh.start_agreement import SECOND, StartAgreement
from lsu_mesh_services.bus import Bus, Clock

SAID_AFTER_NS = SECOND
"""A wait that is longer is told."""
LOOK_S = 0.1


class MeshStart:
    """The start of one peer, over its session.

    Parameters
    ----------
    configuration:
        The mesh.
    role, name:
        The peer.
    known_ns:
        The start that it knows from before; None: none.
    """

    def __init__(self, configuration: Configuration, role: str, name: str, known_ns: int | None = None) -> None:
        self._declared, self._role, self._name, self._known_ns = configuration, role, name, known_ns
        self._asked = model_key(configuration.mesh.name)
        self._agreement: StartAgreement | None = None
        self.other_ns: int | None = None
        """An earlier start that the mesh has, so that this peer has to begin again."""

    def configuration(self, bus: Bus, clock: Clock, stop: Callable[[], bool]) -> Configuration | None:
        """The configuration with its start, once that is known; None if the process is asked to stop before."""
        if not self._declared.awaits_start:
            return self._declared
        who, began = f"{self._role} {self._name}", clock.now()
        agreement = StartAgreement(self._declared, self._role, self._name, began, start_ns=self._known_ns)
        self._agreement = agreement
        bus.declare_alive(key(self._declared.mesh.name, "live", self._name))
        is_told = False
        while agreement.start_ns is None:
            if stop():
                return None
            now = clock.now()
            self._ask(bus, now)
            arrival = bus.next(LOOK_S)
            if arrival is not None and arrival.what == "sample" and arrival.key == self._asked:
                agreement.receive(arrival.payload)
            if agreement.tick(now):
                print(f"{who}: the mesh starts now; its prior has to hold the state of now", file=sys.stderr)
            elif agreement.start_ns is None and not is_told and now - began > SAID_AFTER_NS:
                is_told = True
                print(f"{who}: waits for {agreement.waiting_for()}", file=sys.stderr)
        print(f"{who}: t_0 of the mesh is {moment_text(agreement.start_ns)}", file=sys.stderr)
        return self._declared.started(agreement.start_ns)

    def receives(self, address: str, payload: bytes) -> bool:
        """Whether a sample is an answer about the start; it is noted."""
        if self._agreement is None or address != self._asked:
            return False
        if self._agreement.receive(payload):
            self.other_ns = self._agreement.start_ns
        return True

    def somebody_came(self, now: int) -> None:
        """Who may have another start."""
        if self._agreement is not None:
            self._agreement.ask_soon(now)

    def check(self, bus: Bus, now: int) -> None:
        """Ask again whether all have the same start, when it is time."""
        if self._agreement is not None:
            self._ask(bus, now)

    def _ask(self, bus: Bus, now: int) -> None:
        assert self._agreement is not None
        if self._agreement.questions(now):
            bus.ask_all(self._asked)


def find_start(configuration: Configuration, bus: Bus, clock: Clock, seconds: float) -> Configuration | None:
    """For who only watches: the configuration with the start that the mesh tells, or None if nobody tells one."""
    if not configuration.awaits_start:
        return configuration
    asked, end = model_key(configuration.mesh.name), clock.now() + int(seconds * SECOND)
    agreement = StartAgreement(configuration, "reader", "", clock.now())
    while (now := clock.now()) < end:
        if agreement.questions(now):
            bus.ask_all(asked)
        arrival = bus.next(LOOK_S)
        if arrival is not None and arrival.what == "sample" and arrival.key == asked:
            agreement.receive(arrival.payload)
            if agreement.start_ns is not None:
                return configuration.started(agreement.start_ns)
    return None


def moment_text(time_ns: int) -> str:
    """Nanoseconds since 1970 as ISO text in UTC."""
    seconds, rest = divmod(time_ns, SECOND)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"
