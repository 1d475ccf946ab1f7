"""The epochs of one process, as its events announce them."""

from __future__ import annotations

from collections.abc import Sequence

from lsu_mesh.mesh.messages import Event, Posterior, Prediction

RAISING = ("reset", "epoch-left", "epoch-lost", "bounds-adopted", "prediction-dropped")
"""Codes of events that tell of a new epoch."""
TOO_MANY = "too-many-faults"
Set = Posterior | Prediction


class ProcessEvents:
    """The events of one (src, boot), in the order in which they were sent; ``first`` is its first set."""

    def __init__(self, events: Sequence[Event], first: Set) -> None:
        ordered = sorted(events, key=lambda event: event.seq)
        self._turns = [event for event in ordered if event.code in (*RAISING, "found-start")]
        self._too_many = [event for event in ordered if event.code == TOO_MANY]
        raising = [event for event in ordered if event.code in RAISING]
        number = first.epoch - sum(_is_before(event, first) for event in raising)
        self._told: list[tuple[Event, int]] = []
        for event in raising:
            about = event.about.get("epoch")
            number = about if isinstance(about, int) else number + 1  # an older fusion does not say which
            self._told.append((event, number))

    def told(self, message: Set) -> set[int]:
        """Epochs that the process had announced by then."""
        return {number for event, number in self._told if _is_before(event, message)}

    def is_reset_by_data(self, message: Posterior) -> bool:
        """Whether the data of the message's step ended an epoch: the set is a new one, and the step inconsistent."""
        at_once = [
            event
            for event, number in self._told
            if event.step == message.step and number == message.epoch and _is_before(event, message)
        ]
        return any(
            event.code == "reset" or (event.code == "epoch-left" and "source" not in event.about) for event in at_once
        )

    def is_unsound(self, message: Posterior) -> bool:
        """Whether the process had left its epoch by then with nothing sound to start again from."""
        before = [event for event in self._turns if _is_before(event, message)]
        return bool(before) and before[-1].code in ("epoch-lost", "prediction-dropped")

    def has_too_many_faults(self, message: Posterior) -> bool:
        """Whether a fusion reported, for the message's step, that more sources are wrong than ``faults`` allows."""
        return any(event.step == message.step and _is_before(event, message) for event in self._too_many)


def _is_before(event: Event, message: Set) -> bool:
    """Steps rise within a tick, and no step before a new epoch is done again."""
    return (event.sent_ns, event.step) <= (message.sent_ns, message.step)
