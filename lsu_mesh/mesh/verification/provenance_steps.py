"""What was brought to a set since its base, by steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from lsu_mesh.mesh.messages import Fused, Input, Measurement, Message, Posterior, Prediction, Suggestion
from lsu_mesh.mesh.verification.archive import Archive, DoesNotFit


@dataclass
class Brought:
    """The messages of one step: transfers or sources, measurements, and the input that drives it on."""

    transfers: list[Prediction | Fused] = field(default_factory=list)
    measurements: list[Measurement] = field(default_factory=list)
    sources: list[Posterior] = field(default_factory=list)
    input: Input | None = None
    known: dict[int, Input] = field(default_factory=dict)
    """By step, the inputs that data of this step may have seen."""
    earlier: Input | None = None
    """The input of the step before, as far as it is known."""


def provenance_steps(posterior: Posterior, first: int, archive: Archive, *, acts_late: bool) -> dict[int, Brought]:
    """The steps ``first`` … ``posterior.step`` with what each was given.

    ``acts_late``: whether an input may still act in the step after its own.

    Raises :class:`Unverifiable` where a message is not in the archive, :class:`DoesNotFit` where one cannot have been
    used at these steps.
    """
    if first > posterior.step:
        raise DoesNotFit("base", f"a set of step {first}", f"one of step {posterior.step} or before")
    steps = {k: Brought() for k in range(first, posterior.step + 1)}
    found = [archive.find(reference, Message) for reference in posterior.used]
    is_reach = posterior.base == "reach"  # the inputs before its step went into the base
    messages = [
        message
        for message in found
        if not isinstance(message, Suggestion)  # no matter of a step's data
        and not (is_reach and isinstance(message, Input) and message.step < first)
    ]
    known: dict[int, Input] = {}
    at = first
    for i, message in enumerate(messages):
        k = message.step
        if isinstance(message, Input):
            known[k] = message
            if (acts_late and k == at - 1) or _is_only_seen(messages, i, at):
                continue
            at = k + 1
        elif isinstance(message, Fused) and not isinstance(posterior, Fused):  # carried forward to a later step
            later = (other.step for other in messages[i + 1 :] if not isinstance(other, Fused))
            k = next(later, posterior.step)
        if k not in steps or (isinstance(message, Input) and k == posterior.step):
            span = f"steps {first} to {posterior.step}"
            raise DoesNotFit("used", f"{message.topic} of {message.src} of step {message.step}", f"one of {span}")
        _add(steps[k], message, posterior)
        if isinstance(message, Measurement) and len(known) > len(steps[k].known):
            steps[k].known = dict(known)
    for k, brought in steps.items():
        brought.earlier = known.get(k - 1)
    return steps


def _is_only_seen(messages: Sequence[Message], i: int, at: int) -> bool:
    """Whether an input does not drive the set on from step ``at`` or a later one.

    It is listed before data that see it, by their feedthrough or by the error of their time.
    """
    k = messages[i].step
    upcoming = next((other.step for other in messages[i + 1 :] if isinstance(other, Measurement | Prediction)), None)
    return upcoming is not None and (k < at or k >= upcoming)


def _add(brought: Brought, message: Message, posterior: Posterior) -> None:
    if isinstance(message, Input):
        brought.input = message
    elif isinstance(message, Measurement):
        brought.measurements.append(message)
    elif isinstance(message, Posterior) and isinstance(posterior, Fused):
        brought.sources.append(message)
    elif isinstance(message, Prediction | Fused):
        brought.transfers.append(message)
    else:
        raise DoesNotFit("used", f"a {message.topic} of {message.src}", "measurements, inputs and sets of others")
