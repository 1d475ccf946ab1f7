"""Whether what a set says of its making is possible: known messages, each once, each at its step, no step left out."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from lsu_mesh.mesh.admission import ROLE_OF_TOPIC
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Message, Posterior, Reference
from lsu_mesh.mesh.simulator.broken import InvariantBroken


class Provenance:
    """Steps of all published messages, by their references."""

    def __init__(self, configuration: Configuration) -> None:
        self._steps: dict[Reference, int] = {}
        self._roles = {name: role for role, name in configuration.peers()}
        self._acts_late = configuration.input_delay_ns > 0
        self._sees_inputs = configuration.base_model.input_count > 0 and (
            configuration.input_delay_ns > 0
            or any(one.D or one.time_error_ns for one in configuration.sensors.values())
        )
        self._every_input = configuration.base_model.input_count > 0 and configuration.input_box is None

    def role_of(self, topic: str, name: str) -> str:
        """The role of the peer that publishes a topic under a name."""
        return ROLE_OF_TOPIC.get(topic) or self._roles[name]

    def record(self, message: Message) -> None:
        """A message was published."""
        if message.topic not in ("health", "event", "truth"):
            self._steps[message.reference] = message.step

    def check(self, message: Posterior, taken: Collection[Reference]) -> None:
        """Walk from the base to the step of the set; ``taken``: everything that its maker ever took."""
        where = f"{message.src} step {message.step} revision {message.revision}"
        step = self._base_step(message, taken, where)
        again = ("fused", "input") if self._sees_inputs else ("fused",)  # a box may be carried on again
        once = [reference for reference in message.used if reference[0] not in again]
        if len(set(once)) != len(once):
            raise InvariantBroken("provenance", f"{where}: something was used twice: {message.used}")
        for i, reference in enumerate(message.used):
            if reference not in taken:
                raise InvariantBroken("provenance", f"{where}: used {reference}, which it never took")
            if not (self._sees_inputs and self._is_only_seen(message.used, i, step)):
                step = self._walked(step, reference, where)
        if (self._every_input and step != message.step) or step > message.step:
            raise InvariantBroken("provenance", f"{where}: reaches step {step}: {message.base} {message.used}")

    def _base_step(self, message: Posterior, taken: Collection[Reference], where: str) -> int:
        base = message.base
        if base == "prior":
            return 1
        if isinstance(base, str):  # the domain, or the prior carried on: it does not say its step
            return message.step if not message.used else min(self._steps.get(r, message.step) for r in message.used)
        is_own = base[1] == message.src and base[2] == message.boot
        if base not in self._steps or (not is_own and base not in taken):
            raise InvariantBroken("provenance", f"{where}: made from {base}, which it never had")
        return self._steps[base]

    def _is_only_seen(self, used: Sequence[Reference], i: int, step: int) -> bool:
        """Whether an input is listed because data see it, or because it acts till the next one does: it drives nothing.

        It stands before the data that see it, and is of their step, or of one that is over. Where inputs act late, that
        of the step before stands before the next one, or before the box that is in its place.
        """
        if used[i][0] != "input":
            return False
        own = self._steps[used[i]]
        if self._acts_late and own == step - 1:
            return True
        data = (self._steps[other] for other in used[i + 1 :] if other[0] in ("measurement", "prediction"))
        upcoming = next(data, None)
        return upcoming is not None and (own < step or own >= upcoming)

    def _walked(self, step: int, reference: Reference, where: str) -> int:
        """The step after one more used message."""
        topic, own = reference[0], self._steps[reference]
        if topic == "input":
            if own != step and (self._every_input or own < step):
                raise InvariantBroken("provenance", f"{where}: {reference} of step {own} drove step {step}")
            return own + 1
        if topic == "fused" and own < step:
            return step  # a transferred box of an earlier step
        if own != step and (self._every_input or own < step):
            raise InvariantBroken("provenance", f"{where}: {reference} of step {own} was used at step {step}")
        return own
