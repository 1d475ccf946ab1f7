"""Estimates of the mesh as messages of ROS 2, without a network."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Message, Posterior
from lsu_mesh.mesh.observer import PeerHealth
from lsu_mesh.mesh.ros2.decoder import types_of
from lsu_mesh.mesh.ros2.encoder import DIAGNOSTICS, DIAGNOSTICS_TOPIC, POINT, Encoder, Status, is_tellable
from lsu_mesh.mesh.ros2.settings import Ros2Publication


class Outgoing(NamedTuple):
    """A message for ROS 2."""

    topic: str
    type: str
    payload: bytes


class Ros2Telling:
    """What ``[network.ros2] publish`` names: a point for each newest set, and a diagnostic array.

    The point of a step is told at the time of the step. Sets of steps that are over, which late data made again, are
    not told again; another revision of the newest step is.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._encoder = Encoder(types_of(configuration.network.ros2.distro))
        self._told = configuration.network.ros2.publish
        self._places = {name: i for i, name in enumerate(configuration.base_model.states)}
        self._newest: dict[str, Posterior] = {}
        self.untold = 0
        """Sets whose time no stamp of ROS 2 can say."""

    @property
    def addresses(self) -> list[tuple[str, str]]:
        """Topic and name of what is listened to in the mesh."""
        fused = self._configuration.fusion
        return [("fused" if one.estimator in fused else "posterior", one.estimator) for one in self._told]

    @property
    def topics(self) -> list[tuple[str, str]]:
        """Topic and type of all that is told to ROS 2."""
        found = [(one.topic, POINT) for one in self._told]
        return [*found, (DIAGNOSTICS_TOPIC, DIAGNOSTICS)] if any(one.diagnostics for one in self._told) else found

    def receive(self, message: Message) -> list[Outgoing]:
        """What to tell after a message of the mesh."""
        if not isinstance(message, Posterior):
            return []
        before = self._newest.get(message.name)
        if before is not None and message.boot == before.boot and message.step < before.step:
            return []
        self._newest[message.name] = message
        time_ns = self._configuration.grid.time_of(message.step)
        if not is_tellable(time_ns):
            self.untold += 1
            return []
        return [
            Outgoing(one.topic, POINT, self._encoder.point(time_ns, one.frame_id, self._point(one, message)))
            for one in self._told
            if one.estimator == message.name
        ]

    def _point(self, one: Ros2Publication, message: Posterior) -> list[float]:
        return [message.point[self._places[state]] for state in one.states]

    def diagnostics(self, peers: Sequence[PeerHealth], now: int) -> list[Outgoing]:
        """How the estimators do, with the bounds of their newest sets; nothing where nobody wants it."""
        by_name = {peer.name: peer for peer in peers}
        names = dict.fromkeys(one.estimator for one in self._told if one.diagnostics)
        statuses = [self._status(by_name[name]) for name in names if name in by_name]
        if not statuses or not is_tellable(now):
            return []
        return [Outgoing(DIAGNOSTICS_TOPIC, DIAGNOSTICS, self._encoder.diagnostics(now, statuses))]

    def _status(self, peer: PeerHealth) -> Status:
        newest, values = self._newest.get(peer.name), {}
        if newest is not None:
            values = {"step": str(newest.step), "status": newest.status, "guarantee": newest.guarantee}
            for state, i in self._places.items():
                values |= {f"{state} lower": repr(newest.lower[i]), f"{state} upper": repr(newest.upper[i])}
        name = f"lsu_mesh: {self._configuration.mesh.name}/{peer.role}/{peer.name}"
        message = "; ".join(peer.reasons) or "fine"
        return Status(peer.level, name, message, hardware_id=peer.host or "", values=values)
