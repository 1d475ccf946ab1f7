"""What a bank answers: its last message, and the last set of one instance."""

from __future__ import annotations

from collections.abc import Callable

from lsu_mesh.mesh.keys import instance_key, key, last_key
from lsu_mesh.mesh.messages import encode, encoding
from lsu_mesh.mesh.nodes.bank_filter import BankFilterNode
from lsu_mesh.mesh.nodes.bank_fusion import BankFusionNode
from lsu_mesh_services.bus import Bus

TOPICS = {"bank_posterior": "posterior", "bank_fused": "fused"}
"""Topic of the sets of one instance, by that of the bank's message."""


class BankAnswers:
    """Answers to ``bank_posterior/NAME`` and to ``posterior/NAME/i``, instances counted from 0."""

    def __init__(self, node: BankFilterNode | BankFusionNode) -> None:
        self._node = node
        self._mesh = node.configuration.mesh.name
        self._topic = node.publishes[0]

    def declare(self, bus: Bus) -> None:
        """Answer from now on, on a thread of the network: a message never changes."""
        bus.answer(key(self._mesh, self._topic, self._node.name), self._last)
        if isinstance(self._node, BankFusionNode):
            for name in self._node.sources:
                bus.answer(last_key(self._mesh, name), self._last_of(self._node, name))
        else:
            bus.ask(last_key(self._mesh, self._node.name))
        bus.answer_each(instance_key(self._mesh, TOPICS[self._topic], self._node.name, "*"), self._one)

    def _last(self) -> tuple[str, bytes, str] | None:
        last = self._node.last
        return (
            None
            if last is None
            else (key(self._mesh, self._topic, self._node.name), encode(last), encoding(last.topic))
        )

    def _last_of(self, node: BankFusionNode, name: str) -> Callable[[], tuple[str, bytes, str] | None]:
        """The newest posterior of a source."""

        def answer() -> tuple[str, bytes, str] | None:
            last = node.last_of.get(name)
            return None if last is None else (last_key(self._mesh, name), encode(last), encoding(last.topic))

        return answer

    def _one(self, asked: str) -> tuple[bytes, str] | str:
        last, text = self._node.last, asked.rpartition("/")[2]
        if last is None:
            return f"{self._node.name} has published nothing yet"
        if not text.isascii() or not text.isdigit() or len(text) > 9 or int(text) >= last.instances:
            return f"{self._node.name} has instances 0 to {last.instances - 1}, not {text}; ask for one of them"
        found = self._node.one(last, int(text))  # type: ignore[arg-type]
        return encode(found), encoding(found.topic)
