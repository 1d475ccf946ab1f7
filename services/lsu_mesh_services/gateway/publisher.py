"""Publishes measurements that came over HTTP, as the sensors themselves would."""

from __future__ import annotations

import argparse
import copy
import secrets
import threading

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.live_times import check_live_time
from lsu_mesh.mesh.measurement_time import placed
from lsu_mesh.mesh.messages import VERSION, Measurement, Refused, encode, encoding
from lsu_mesh_services.bus import Bus, Clock, NoSession
from lsu_mesh_services.gateway.measurement_request import Reading
from lsu_mesh_services.gateway.refusal import Refusal
from lsu_mesh_services.network.security import InsecureSession
from lsu_mesh_services.session import session_settings


class Publisher:
    """One per gateway; sequence numbers count per sensor, ``boot`` is drawn at the start.

    Without TLS the gateway's own session publishes. With TLS that session shows the reader's certificate, which may
    publish nothing: each sensor then has a session of its own, with the certificate of the sensor.
    """

    def __init__(self, bus: Bus, clock: Clock, options: argparse.Namespace) -> None:
        self._bus, self._clock, self._options = bus, clock, options
        self._boot = secrets.token_hex(8)
        self._lock = threading.Lock()
        self._sequences: dict[str, int] = {}
        self._sessions: dict[str, Bus] = {}

    def publish(self, configuration: Configuration, name: str, reading: Reading) -> Measurement:
        """Send a reading of the sensor; returns the message, with the step that its time belongs to.

        Raises
        ------
        Refusal
            403 without the sensor's certificate, 422 where the time cannot be true, 409 where the model cannot use a
            datum of this time, 503 where the mesh has not told its start or nobody is connected.
        """
        with self._lock:
            message = self._message(configuration, name, reading)
            found = _checked(configuration, message)
            bus = self._session(configuration, name)
            if not self._bus.links():
                text = "the gateway is connected to nobody; the measurement was not sent"
                raise Refusal(503, text, "start the mesh with `lsu-mesh run`, then send again")
            self._sequences[name] = message.seq + 1
            bus.publish(key(configuration.mesh.name, "measurement", name), encode(message), encoding("measurement"))
        return found

    def close(self) -> None:
        """Close the sessions of the sensors."""
        with self._lock:
            for bus in self._sessions.values():
                bus.close()
            self._sessions.clear()

    def _message(self, configuration: Configuration, name: str, reading: Reading) -> Measurement:
        now = self._clock.now()
        return Measurement(
            v=VERSION,
            src=f"sensor/{name}",
            boot=self._boot,
            seq=self._sequences.get(name, 0),
            step=0,
            sent_ns=now,
            origin_ns=now,
            model=configuration.digest(),
            y=reading.y,
            time_ns=reading.time_ns,
            time_error_ns=reading.time_error_ns,
        )

    def _session(self, configuration: Configuration, name: str) -> Bus:
        if not configuration.network.tls.enabled:
            return self._bus
        if name not in self._sessions:
            options = copy.copy(self._options)
            options.role, options.name = "sensor", name
            try:
                self._sessions[name] = Bus(session_settings(configuration, options), self._clock)
            except (InsecureSession, NoSession) as error:
                text = f"with TLS, the gateway may publish only where its certificate allows: {error}"
                remedy = f"put the certificate and the key of {name!r} on the gateway's host, or send from the sensor's"
                raise Refusal(403, text, remedy) from None
        return self._sessions[name]


def _checked(configuration: Configuration, message: Measurement) -> Measurement:
    """The message with its step, if those who receive it will take it."""
    if configuration.awaits_start:
        text = "no estimator of the mesh has told when it started, so no time can be brought to a step"
        raise Refusal(503, text, "start the mesh with `lsu-mesh run`, then send again")
    try:
        check_live_time(configuration, message, message.sent_ns)
    except Refused as refused:
        remedy = 'correct the clock of the sensor, or send "time": "now"'
        raise Refusal(422, str(refused), remedy, key="time", value=message.time_ns) from None
    try:
        return placed(configuration, message)
    except Refused as refused:
        remedy = "send the time of the measurement as the model can use it, see docs/configuration.md"
        raise Refusal(409, str(refused), remedy, key="time", value=message.time_ns) from None
