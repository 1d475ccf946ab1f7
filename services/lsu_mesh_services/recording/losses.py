"""What is missing in a recording, by the numbers that the recorder gave to what it wrote."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Integers
from lsu_mesh_services.recording.chunks import Damage

MAX_LOST = 5 * 10**7
"""A longer gap is no loss: a recorder that was started again counts on from its clock."""
FOLD_AT = 2**20
"""Integers that are collected before they are joined."""


class Loss(NamedTuple):
    """So many messages in a row are missing, which were recorded between those of two steps."""

    messages: int
    first_step: int
    last_step: int


class Losses:
    """Finds the gaps in the numbers of messages, which come in any order, in bounded memory."""

    def __init__(self) -> None:
        self._waiting: list[tuple[Integers, Integers]] = []
        self._count = 0
        self._runs: Integers = np.empty((4, 0), dtype=np.int64)
        """Per run of numbers the first, the last, and the steps of both."""

    def add(self, numbers: Integers, steps: Integers) -> None:
        """Integers that are there, and their steps; 0: of none."""
        self._waiting.append((numbers, steps))
        self._count += len(numbers)
        if self._count > FOLD_AT:
            self._fold()

    def found(self) -> list[Loss]:
        """What is missing between the numbers that came."""
        self._fold()
        first, last, first_step, last_step = self._runs
        missing = first[1:] - last[:-1] - 1
        return [
            Loss(int(missing[i]), min(int(last_step[i]), int(first_step[i + 1])), int(first_step[i + 1]))
            for i in np.flatnonzero((missing > 0) & (missing < MAX_LOST))
        ]

    def _fold(self) -> None:
        if not self._waiting:
            return
        numbers, steps = (np.concatenate(parts) for parts in zip(*self._waiting, strict=True))
        self._waiting, self._count = [], 0
        runs = np.concatenate([self._runs, np.stack([numbers, numbers, steps, steps])], axis=1)
        runs = runs[:, np.argsort(runs[0], kind="stable")]
        first, last, first_step, last_step = runs
        _fill(first_step)
        _fill(last_step)
        reach = np.maximum.accumulate(last)
        begins = np.flatnonzero(np.concatenate([[True], first[1:] > reach[:-1] + 1]))
        ends = np.concatenate([begins[1:] - 1, [len(first) - 1]])
        self._runs = np.stack([first[begins], reach[ends], first_step[begins], last_step[ends]])


def _fill(steps: Integers) -> None:
    """What is of no step gets that of what came before it."""
    known = np.where(steps > 0, np.arange(len(steps)), 0)
    steps[:] = steps[np.maximum.accumulate(known)]


def damage_words(damage: Damage, lost: int, losses: list[Loss]) -> list[str]:
    """What is damaged and what that cost, for people; empty where nothing is."""
    words = []
    if damage.cut:
        words.append(f"cut short: {damage.cut} file(s) end within a message, as after the kill of a recorder")
    if damage:
        text = (
            f"{damage.places} place(s) of {damage.bytes} bytes, {damage.chunks} chunk(s), {damage.rows} single row(s)"
        )
        words.append(f"damaged: {text} in {', '.join(damage.files)}")
    if lost:
        shown = ", ".join(_loss_words(loss) for loss in losses[:10])
        words.append(f"lost: {lost} message(s): {shown}{', …' if len(losses) > 10 else ''}")
    return words


def _loss_words(loss: Loss) -> str:
    between = (
        f"step {loss.first_step}" if loss.first_step == loss.last_step else f"steps {loss.first_step}–{loss.last_step}"
    )
    return f"{loss.messages} of {between}"
