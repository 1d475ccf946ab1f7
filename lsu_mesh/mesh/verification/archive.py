"""The messages of a recording, found by reference (topic, src, boot, seq)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import TypeVar

from lsu_mesh.mesh.messages import Input, Measurement, Message, Posterior, Prediction, Reference, Smoothed, Truth

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
        self._by_name: defaultdict[tuple[str, int], list[Message]] = defaultdict(list)
        """Measurements, posteriors and fused sets by the name of their peer and their step."""
        self._posteriors: defaultdict[tuple[str, str, int], list[Posterior]] = defaultdict(list)
        for message in messages:
            if message.reference not in self._messages:
                self._messages[message.reference] = message
                self._record_message(message)

    def _record_message(self, message: Message) -> None:
        if isinstance(message, Input):
            self.inputs.setdefault(message.step, message)
        elif isinstance(message, Truth):
            self.truth.setdefault(message.step, message.x)
        elif isinstance(message, Posterior):
            self._posteriors[message.src, message.boot, message.step].append(message)
        if isinstance(message, Measurement | Posterior):
            self._by_name[message.name, message.step].append(message)

    def messages(self, kind: type[Kind]) -> list[Kind]:
        """All messages of a kind, in the order of arrival."""
        return [message for message in self._messages.values() if isinstance(message, kind)]

    def of_step(self, name: str, step: int) -> list[Message]:
        """The messages of a sensor, a filter or a fusion about a step."""
        return self._by_name.get((name, step), [])

    def newest(self, name: str, step: int, before_ns: int) -> Posterior | None:
        """The newest set of a step that a peer had sent by then."""
        found = [one for one in self.of_step(name, step) if isinstance(one, Posterior) and one.sent_ns <= before_ns]
        return max(found, key=lambda one: (one.sent_ns, one.seq), default=None)

    def has(self, reference: Reference) -> bool:
        """Whether a message is in the recording."""
        return reference in self._messages

    def sets(self) -> list[Posterior | Prediction | Smoothed]:
        """All published sets, in the order of arrival, but each after the sets that it was made from.

        Messages of one process on several keys may overtake one another on their way to the recorder.
        """
        ordered: dict[Reference, Posterior | Prediction | Smoothed] = {}
        begun: set[Reference] = set()  # what is begun and not yet in order is being waited for: a circle is not closed
        for message in self._messages.values():
            waiting = [message] if isinstance(message, Posterior | Prediction | Smoothed) else []
            while waiting:
                one = waiting[-1]
                begun.add(one.reference)
                ahead = [other for other in self._made_from(one) if other.reference not in begun]
                if ahead:
                    waiting += ahead
                else:
                    ordered.setdefault(one.reference, waiting.pop())
        return list(ordered.values())

    def _made_from(self, message: Posterior | Prediction | Smoothed) -> Sequence[Posterior | Prediction]:
        """The sets that a set was made from, as far as they are here."""
        if isinstance(message, Prediction) and message.base is None:
            earlier = self._posteriors_before(message)
            return [max(earlier, key=lambda posterior: posterior.seq)] if earlier else []
        base = [message.base] if isinstance(message.base, tuple) else []
        used = () if isinstance(message, Smoothed) else message.used
        found = [self._messages.get(reference) for reference in (*base, *used)]
        return [other for other in found if isinstance(other, Posterior | Prediction)]

    def find(self, reference: Reference, kind: type[Kind]) -> Kind:
        """The message of a reference. Raises :class:`Unverifiable` where it is not there."""
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
        earlier = self._posteriors_before(prediction)
        if not earlier:
            text = f"the posterior of step {prediction.step - 1} from the same process is not in the recording"
            raise Unverifiable(text)
        return max(earlier, key=lambda posterior: posterior.seq)

    def _posteriors_before(self, prediction: Prediction) -> list[Posterior]:
        """Revisions of the posterior of the step before that the process had published by then."""
        listed = self._posteriors.get((prediction.src, prediction.boot, prediction.step - 1), [])
        return [posterior for posterior in listed if posterior.sent_ns <= prediction.sent_ns]
