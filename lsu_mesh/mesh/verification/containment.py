"""Where the truth is recorded: whether the sets hold it, and whether what they rest on was true.

A set must hold the true state if the declared bounds were kept by everything that it descends from. Measurements whose
noise exceeds its declared half-width are found by exact arithmetic; sets that rest on one are counted apart. A relaxed
fusion may rest on as many wrong sources as it allows.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.config.settings import Configuration, SensorSettings
from lsu_mesh.mesh.messages import (
    Fused,
    Guarantee,
    Input,
    Measurement,
    Message,
    Posterior,
    Prediction,
    Reference,
    Smoothed,
)
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.mesh.verification.archive import Archive, Unverifiable

NOT_THERE = "what is not in the recording"


class Miss(NamedTuple):
    """A set that does not hold the true state."""

    peer: str
    topic: str
    step: int
    seq: int
    state: str

    def __str__(self) -> str:
        return f"{self.peer}, step {self.step}, {self.topic} {self.seq} misses the truth: {self.state}"


@dataclass
class Containment:
    """``holding`` sets hold the truth; ``misses`` must and do not; ``excused`` rest on something that was not true."""

    configuration: Configuration | None = None
    archive: Archive = field(default_factory=lambda: Archive([]))
    holding: int = 0
    misses: list[Miss] = field(default_factory=list)
    excused: Counter[str] = field(default_factory=Counter)
    """Sets that miss the truth, by what they rest on."""
    broken: dict[str, str] = field(default_factory=dict)
    """By sensor: the first measurement that is farther from the truth than declared."""
    _reasons: dict[Reference, str] = field(default_factory=dict)
    """Sets that rest on something that was not true, and on what."""
    _measured: dict[Reference, str] = field(default_factory=dict)

    @classmethod
    def of(cls, configuration: Configuration, archive: Archive) -> Containment:
        """For the sets of a recording."""
        return cls(configuration, archive)

    def check(self, message: Posterior | Prediction | Smoothed, proved: Guarantee | None) -> None:
        """Check one set, after all that it was made from; ``proved``: its guarantee, recomputed from these."""
        truth = self.archive.truth.get(message.step)
        reason = self._reason(message, proved)
        if reason:
            self._reasons[message.reference] = reason
        if truth is None:
            return
        outside = self._outside(message, truth)
        if not outside:
            self.holding += 1
        elif reason:
            self.excused[reason] += 1
        else:
            self.misses.append(
                Miss(peer=message.src, topic=message.topic, step=message.step, seq=message.seq, state=outside)
            )

    def _outside(self, message: Posterior | Prediction | Smoothed, x: list[float]) -> str:
        """Words that say how the truth is outside of a set; "" where it is not."""
        assert self.configuration is not None
        states = self.configuration.base_model.states
        for name, low, value, high in zip(states, message.lower, x, message.upper, strict=True):
            if not low <= value <= high:
                return f"{name} = {value!r} is not in [{low!r}, {high!r}]"
        if not to_support(message.support).contains(x):
            return f"x = {x!r} is proved to lie outside of the support"
        return ""

    def _reason(self, message: Posterior | Prediction | Smoothed, proved: Guarantee | None) -> str:
        """What a set rests on that was not true; "" where everything was. What it says of itself excuses nothing."""
        if proved not in (None, "declared"):
            return f"guarantee {proved!r}"
        if isinstance(message, Prediction) and message.base is None:
            try:
                return self._reasons.get(self.archive.posterior_before(message).reference, "")
            except Unverifiable:
                return NOT_THERE
        base = self._base_reason(message)
        if isinstance(message, Smoothed):
            return base
        used = [reason for reference in message.used if (reason := self._used_reason(reference))]
        if isinstance(message, Fused) and POLICIES[message.policy].takes_faults:
            used = used[message.faults :] if not _spans_steps(message, self.archive) else used
        return base or next(iter(used), "")

    def _base_reason(self, message: Posterior | Prediction | Smoothed) -> str:
        assert self.configuration is not None
        truth = self.archive.truth
        if message.base == "prior":
            x, prior = truth.get(1), self.configuration.prior
            return "" if x is None or prior.contains(x) else "the prior, which misses the true state of step 1"
        if message.base in ("domain", "sources"):
            return ""
        reference = message.base
        if not isinstance(reference, tuple):
            return ""
        return self._reasons.get(reference, "") if self.archive.has(reference) else NOT_THERE

    def _used_reason(self, reference: Reference) -> str:
        if reference[0] in ("posterior", "fused", "prediction"):
            return self._reasons.get(reference, "") if self.archive.has(reference) else NOT_THERE
        if reference[0] != "measurement":
            return ""
        if reference not in self._measured:
            try:
                message = self.archive.find(reference, Measurement)
            except Unverifiable:
                self._measured[reference] = NOT_THERE
            else:
                self._measured[reference] = self._noise_reason(message)
        return self._measured[reference]

    def _noise_reason(self, message: Measurement) -> str:
        """Names the sensor whose measurement is farther from the truth than its r, in exact arithmetic.

        Nothing is said of data between the steps, or whose time is not known exactly: the truth of their moment is not
        recorded.
        """
        assert self.configuration is not None
        sensor, x = self.configuration.sensors[message.name], self.archive.truth.get(message.step)
        if x is None or not self._is_of_its_step(message):
            return ""
        for row, r, y, output in zip(range(len(sensor.r)), sensor.r, message.y, sensor.outputs, strict=True):
            noise = None if y is None else self._noise(sensor, row, Fraction(y), x=x, k=message.step)
            if noise is not None and noise > Fraction(r):
                words = f"step {message.step}: {output} is off by {float(noise):.6g}, r = {r:.6g}"
                self.broken.setdefault(message.name, words)
                return f"sensor {message.name}"
        return ""

    def _is_of_its_step(self, message: Measurement) -> bool:
        assert self.configuration is not None
        on_grid = message.time_ns == self.configuration.grid.time_of(message.step)
        return message.time_error_ns is None or (message.time_error_ns == 0 and on_grid)

    def _acting(self, k: int) -> Input | None:
        """The input that acts at t_k; ``None`` where it is not known."""
        assert self.configuration is not None
        message = self.archive.inputs.get(k)
        if message is None or not self.configuration.input_delay_ns:
            return message
        if message.time_ns is None:
            return None
        return message if message.time_ns <= self.configuration.grid.time_of(k) else self.archive.inputs.get(k - 1)

    def _noise(self, sensor: SensorSettings, row: int, y: Fraction, *, x: list[float], k: int) -> Fraction | None:
        """``|y − C x − D u − d|``, of the nearest period; ``None`` where the input that it sees is not known."""
        assert self.configuration is not None
        expected = _product(sensor.C[row], x) + (Fraction(sensor.offset[row]) if sensor.offset else 0)
        if sensor.D and any(sensor.D[row]):
            message = self._acting(k)
            if message is None:
                return None
            expected += _product(sensor.D[row], message.u)
        noise = y - expected
        period = sensor.period[row] if sensor.period else 0.0
        if not period:
            return abs(noise)
        turns = round(noise / Fraction(period))
        # a period such as 2π is the number that its double stands for: it is known to the double's spacing
        return abs(noise - turns * Fraction(period)) - abs(turns) * Fraction(math.ulp(period))


def _product(row: Sequence[float], x: Sequence[float]) -> Fraction:
    return sum((Fraction(c) * Fraction(v) for c, v in zip(row, x, strict=True)), Fraction(0))


def _spans_steps(message: Posterior, archive: Archive) -> bool:
    """Whether a set used sources of more than one step."""
    found = []
    for reference in message.used:
        if reference[0] in ("posterior", "fused"):
            try:
                found.append(archive.find(reference, Message).step)
            except Unverifiable:
                continue
    return len(set(found)) > 1
