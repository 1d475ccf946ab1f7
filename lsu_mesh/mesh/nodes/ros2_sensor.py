"""Sensors that listen to a topic of ROS 2."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lsu_mesh.mesh.access import PUBLISHES
from lsu_mesh.mesh.config.settings import CACHED_SECONDS, Configuration
from lsu_mesh.mesh.messages import Measurement, Message
from lsu_mesh.mesh.nodes.node import LONG_NS, REMEMBERED_NS, SECOND, Complaint, Node, Rise
from lsu_mesh.mesh.ros2.decoder import Decoder, Reading, UnfitMessage, type_hash_of, types_of
from lsu_mesh.mesh.ros2.dialects import dialect_of
from lsu_mesh.mesh.ros2.listening import Listening

MAX_HZ = 1000
"""Messages per second of which late joiners can get as much of the past as of the others'."""


class Ros2SensorNode(Node):
    """Publishes every message of its topic as a measurement at the time of its stamp, with step 0: the mesh counts.

    A message that is of another type, that cannot be decoded or that has no usable stamp is refused and counted by its
    reason, and the health names the last one. With ``stamp = "receive"`` the time is that of the arrival, known to
    within ``time_error``; what came while the process stood still waited for longer, and is refused.
    """

    role = "sensor"
    publishes = PUBLISHES["sensor"]

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        super().__init__(configuration, name, boot)
        settings, network = configuration.sensors[name], configuration.network.ros2
        assert settings.ros2 is not None
        self.topic = settings.ros2
        self.dialect = dialect_of(network)
        self.type_hash = type_hash_of(network.distro, self.topic.type)
        self.listening = Listening()
        self._error_ns = settings.time_error_ns
        store, is_stamped = types_of(network.distro), self.topic.stamp == "header"
        self._decoder = Decoder(store, self.topic.type, self.topic.fields, stamped=is_stamped)
        self.messages_per_step = max(1, math.ceil(CACHED_SECONDS * MAX_HZ / configuration.cached))
        self._refusals: dict[str, int] = {}
        self._last_refusal = ""
        self._told_ns: dict[str, int] = {}
        self._recently_refused, self._recently_lost = Rise(), Rise()
        self._newest_ns: int | None = None

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return ()

    def receive(self, message: Message, now: int) -> list[Message]:
        return []

    def advance(self, now: int) -> list[Message]:
        return []

    def take(self, key: str, payload: bytes, attachment: bytes, arrival_ns: int) -> list[Message]:
        """Take a message of ROS 2 as it came; return what to publish."""
        self.listening.note(attachment, arrival_ns)
        try:
            if wrong := self.dialect.refusal(key, self.topic.type, self.type_hash):
                raise UnfitMessage("type", wrong)
            if self.topic.stamp == "receive" and self.admission.stood_still:
                raise UnfitMessage("standstill", "this process stood still, and nobody knows when the message came")
            reading = self._decoder.decode(payload)
        except UnfitMessage as unfit:
            return self._refuse(unfit, arrival_ns)
        return [self._measurement(reading, arrival_ns)]

    def _measurement(self, reading: Reading, arrival_ns: int) -> Measurement:
        time_ns = arrival_ns if reading.time_ns is None else reading.time_ns
        self._newest_ns = time_ns
        stamp = self.stamp("measurement", 0, arrival_ns)
        return Measurement(**stamp, y=reading.y, time_ns=time_ns, time_error_ns=self._error_ns)

    def _refuse(self, unfit: UnfitMessage, now: int) -> list[Message]:
        """Count it; an event tells a reason at most once in five seconds."""
        self._refusals[unfit.reason] = self._refusals.get(unfit.reason, 0) + 1
        self._last_refusal = str(unfit)
        told = self._told_ns.get(unfit.reason)
        if told is not None and now - told < REMEMBERED_NS:
            return []
        self._told_ns[unfit.reason] = now
        about: dict[str, str | int | float | None] = {
            "sensor": self.name, "topic": self.topic.topic, "reason": unfit.reason,
        }  # fmt: skip
        text = f"a message of {self._topic_name} is refused: {unfit}"
        return [self.event("WARN", "ros2-refused", text, now=now, step=0, about=about)]

    @property
    def _topic_name(self) -> str:
        return self.dialect.topic(self.topic.topic)

    def complaints(self, now: int) -> list[Complaint]:
        found = super().complaints(now)
        silence = self.listening.silence_ns(now)
        if silence is not None:
            level = "ERROR" if silence > LONG_NS else "WARN"
            found.append(Complaint(level, f"nothing of {self._topic_name} for {silence / SECOND:.1f} s: {self._why()}"))
        refused = sum(self._refusals.values())
        if self._recently_refused.is_recent(refused, now):
            text = f"refused {refused} message(s) of {self._topic_name} so far, last: {self._last_refusal}"
            found.append(Complaint("ERROR" if refused == self.listening.received else "WARN", text))
        lost = self.listening.lost
        if self._recently_lost.is_recent(lost, now):
            found.append(Complaint("WARN", f"{lost} message(s) of {self._topic_name} so far were lost on the way"))
        publishers = self.listening.publishers.values()
        if len(publishers) > 1:
            nodes = ", ".join(sorted(one.node for one in publishers))
            found.append(Complaint("WARN", f"{len(publishers)} publishers send {self._topic_name}: {nodes}"))
        return found

    def _why(self) -> str:
        """What is known of a topic that is silent."""
        network, known = self.configuration.network.ros2, self.listening.publishers.values()
        if self.listening.links == 0:
            where = ", ".join((*network.connect, *network.listen)) or "nowhere, as [network.ros2] connect is empty"
            return f"no link to ROS 2, looked for at {where}; start rmw_zenohd or the bridge, or set connect"
        if not known:
            return f"no publisher of it in domain {network.domain_id}; see the topics by: ros2 topic list"
        types = sorted({one.type for one in known})
        if types != [self.topic.type]:
            return f"its publisher sends {', '.join(types)}, not {self.topic.type}"
        return f"{', '.join(sorted(one.node for one in known))} is there and sends nothing"

    def counters(self) -> dict[str, float]:
        counts = {"ros2 received": self.listening.received, "ros2 lost": self.listening.lost}
        counts |= {f"ros2 refused: {reason}": count for reason, count in self._refusals.items()}
        return {words: float(count) for words, count in counts.items() if count}

    def step(self) -> int:
        return 0 if self._newest_ns is None else max(0, self.configuration.grid.step_of(self._newest_ns))
