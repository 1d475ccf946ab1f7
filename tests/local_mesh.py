"""A whole mesh in one process: nodes, their keys, and a clock that the test turns."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.bank_messages import BANK_TYPES
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import TYPES, Event, Message, Posterior, Truth, encode
from lsu_mesh.mesh.nodes.bank_nodes import bank_node
from lsu_mesh.mesh.nodes.file_sensor import FileSensorNode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode
from lsu_mesh.mesh.nodes.identifier import IdentifierNode
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh.mesh.nodes.plant import PlantNode
from lsu_mesh.mesh.nodes.schedule import Schedule
from lsu_mesh.mesh.nodes.sensor import SimulatedSensorNode

Carry = Callable[[str, bytes, Node], bool]
MILLISECOND = 1_000_000


def boot(number: int) -> str:
    """A boot identifier."""
    return f"{number:016x}"


class LocalMesh:
    """Delivers every message at once, unless ``carry`` (key, payload, receiver) says no."""

    def __init__(self, configuration: Configuration, carry: Carry | None = None) -> None:
        self.configuration = configuration
        self.now = 0
        self.sent: list[tuple[str, Message]] = []
        self.nodes: dict[str, Node] = {}
        self._carry = carry or (lambda address, payload, node: True)
        self._boots = 0
        self._reader = Admission(configuration, (*TYPES, *BANK_TYPES))
        for role, name in configuration.peers():
            if role != "recorder":
                self.start(role, name)

    def start(self, role: str, name: str) -> Node:
        """Start a peer, or start it again."""
        self._boots += 1
        node = self._made(role, name, boot(self._boots))
        self.nodes[name] = node
        return node

    def _made(self, role: str, name: str, identity: str) -> Node:
        schedule = Schedule(0, self.configuration.mesh.rate)
        if self.configuration.instances is not None:
            return bank_node(self.configuration, role, name, identity, schedule=schedule)
        if role == "plant":
            return PlantNode(self.configuration, name, identity, schedule)
        if role == "filter":
            return FilterNode(self.configuration, name, identity)
        if role == "fusion":
            return FusionNode(self.configuration, name, identity)
        if role == "identifier":
            return IdentifierNode(self.configuration, name, identity)
        if self.configuration.sensors[name].file is not None:
            return FileSensorNode(self.configuration, name, identity, schedule)
        return SimulatedSensorNode(self.configuration, name, identity)

    def kill(self, name: str) -> None:
        """A peer is gone."""
        del self.nodes[name]

    def run(self, seconds: float, tick_ms: int = 5) -> None:
        """Let time pass."""
        end = self.now + round(seconds * 1e9)
        while self.now < end:
            self.turn()
            self.now += tick_ms * MILLISECOND
        self.turn()

    def turn(self) -> None:
        """Tick every node until nothing moves."""
        moved = True
        while moved:
            before = len(self.sent)
            for node in list(self.nodes.values()):
                self.publish(node, node.tick(self.now))
            moved = len(self.sent) > before

    def publish(self, node: Node, messages: Sequence[Message]) -> None:
        """Hand a node's messages to everyone who listens; one that receivers would refuse is a mistake of the node."""
        for message in messages:
            address, payload = node.key(message), encode(message)
            assert self._reader.admit(address, payload) is not None, self._reader.last_refusal
            self.sent.append((address, message))
            self.hand_over(address, payload)

    def hand_over(self, address: str, payload: bytes) -> None:
        """Deliver a payload to all subscribers."""
        mesh = self.configuration.mesh.name
        for node in list(self.nodes.values()):
            listens = any(key(mesh, topic, name) == address for topic, name in node.subscriptions())
            if listens and self._carry(address, payload, node):
                self.publish(node, node.deliver(address, payload, self.now))

    def of(self, kind: type[Message], name: str = "") -> list[Message]:
        """Everything of a kind that was published, by one peer or by all."""
        return [m for _, m in self.sent if type(m) is kind and name in ("", m.name)]

    def truth(self) -> dict[int, list[float]]:
        """True states by step."""
        return {m.step: m.x for m in self.of(Truth) if isinstance(m, Truth)}

    def posteriors(self, name: str) -> list[Posterior]:
        """What a filter or a fusion has published, in order."""
        return [m for _, m in self.sent if isinstance(m, Posterior) and m.name == name]

    def newest(self, name: str) -> dict[int, Posterior]:
        """The newest revision of each step."""
        return {m.step: m for m in self.posteriors(name)}

    def events(self, code: str) -> list[Event]:
        """Events with a code."""
        return [m for _, m in self.sent if isinstance(m, Event) and m.code == code]

    def estimators(self) -> list[str]:
        """Names of filters and fusions."""
        return [*self.configuration.filters, *self.configuration.fusion]
