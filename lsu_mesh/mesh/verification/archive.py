"""The messages of a recording, found by the names that others call them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from lsu_mesh.mesh.messages import Input, Message, Posterior, Prediction, Reference, Truth
from lsu_mesh.supports.support import Vector

Kind = TypeVar("Kind", bound=Message)


class Unverifiable(Exception):
    """What a set was made from is not in the recording; the text names what is missing."""


class DoesNotFit(Exception):
    """The provenance of a set cannot be true; ``field`` of the message says what the recording shows to be wrong."""

    def __init__(self, field: str, recorded: object, expected: str) -> None:
        super().__init__(f"{field}: {recorded} in the recording, expected {expected}")
        self.field = field
        self.recorded = recorded
        self.expected = expected


class Archive:
    """All messages of a recording; the first of each (topic, src, boot, seq) counts."""

    def __init__(self, messages: Iterable[Message]) -> None:
        self._messages: dict[Reference, Message] = {}
        self.inputs: dict[int, Input] = {}
        """The first input of each step."""
        self.truth: dict[int, list[float]] = {}
        self._posteriors: defaultdict[tuple[str, str, int], list[Posterior]] = defaultdict(list)
        for message in messages:
            if message.reference not in self._messages:
                self._messages[message.reference] = message
                self._note(message)

    def _note(self, message: Message) -> None:
        if isinstance(message, Input):
            self.inputs.setdefault(message.step, message)
        elif isinstance(message, Truth):
            self.truth.setdefault(message.step, message.x)
        elif isinstance(message, Posterior):
            self._posteriors[message.src, message.boot, message.step].append(message)

    def sets(self) -> list[Posterior | Prediction]:
        """Everything that claims to hold the state, in the order of arrival."""
        return [message for message in self._messages.values() if isinstance(message, Posterior | Prediction)]

    def find(self, reference: Reference, kind: type[Kind]) -> Kind:
        """The message that is called so. Raises :class:`Unverifiable` where it is not there."""
        topic, src, boot, seq = reference
        message = self._messages.get(reference)
        if message is None:
            raise Unverifiable(f"{topic} {seq} of {src} (boot {boot}) is not in the recording")
        if not isinstance(message, kind):
            raise DoesNotFit("used", f"{topic} {seq} of {src}", f"a {kind.topic}")
        return message

    def posterior_before(self, prediction: Prediction) -> Posterior:
        """The posterior of the step before that a prediction was made from: the process's latest at that time.

        Raises :class:`Unverifiable` where it is not there.
        """
        step = prediction.step - 1
        listed = self._posteriors.get((prediction.src, prediction.boot, step), [])
        earlier = [posterior for posterior in listed if posterior.sent_ns <= prediction.sent_ns]
        if not earlier:
            raise Unverifiable(f"the posterior of step {step} from the same process is not in the recording")
        return max(earlier, key=lambda posterior: posterior.seq)

    def input_vector(self, step: int) -> Vector | None:
        """The input that drives ``step`` on, (p,); None where none is recorded."""
        message = self.inputs.get(step)
        return None if message is None else np.array(message.u)
