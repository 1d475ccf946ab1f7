"""The record of steps: what has come for each, inputs, when it was first heard of, and which must be done again."""

from __future__ import annotations

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.step_arrivals import StepArrivals
from lsu_mesh.mesh.estimation.step_record import Step
from lsu_mesh.mesh.messages import Input, Measurement, Message

SECOND = 1_000_000_000
BEHIND = 32
"""So many complete steps in the queue and intermediate results are no longer published."""
BEHIND_LATE = 4
"""The same where more waits in front of the node."""
INPUT_LOST = 256
"""So many later inputs have come, and so many that their publisher keeps no more of them: this one does not come."""
MAX_STEPS = 4096
"""Steps that are remembered while something is waited for, or twice those that publishers keep where these are more."""


class Timeline:
    """Steps by number, up to ``history`` steps behind the one that the estimator is at (``current``).

    Parameters
    ----------
    configuration:
        The mesh, for its rate and for how much publishers keep.
    history:
        How many steps back a late message may come.
    remembered:
        How many steps back inputs are kept, so that all of ``history`` can be done again.
    """

    def __init__(self, configuration: Configuration, history: int, remembered: int) -> None:
        self.current: int | None = None
        self.is_combined = False
        """Whether the data of the current step are in the set."""
        self.arrivals = StepArrivals(configuration.mesh.rate / SECOND)
        self.first_evidence: int | None = None
        self.from_the_future = 0
        """Messages of steps too far ahead to be true."""
        self.inputs: dict[int, Input] = {}
        """The inputs of the steps that are remembered."""
        self._steps: dict[int, Step] = {}
        self._history = history
        self._remembered = remembered
        self._input_lost = max(INPUT_LOST, configuration.cached)
        self._max_steps = max(MAX_STEPS, 2 * configuration.cached)
        self._newest_input = self._lost_before = 0
        self._gives_up_inputs = False
        self.is_late = False
        """Whether more has come than is known here."""
        self._acts_late = configuration.input_delay_ns > 0
        self._dirty: int | None = None
        self._saw_box: dict[int, set[int]] = {}

    # -- what came

    def see(self, k: int, now: int) -> Step | None:
        """The record of step k, of which something came; None when it lies before all that is remembered."""
        if self.current is not None and k < self.current - self._history:
            return None
        if self.current is not None and self.arrivals.is_from_the_future(k, now):
            self.from_the_future += 1
            return None
        self.arrivals.record(k, now)
        if self.first_evidence is None:
            self.first_evidence = now
        step = self._steps.setdefault(k, Step())
        if len(self._steps) > self._max_steps and self.current is None:
            self._forget(min(self._steps))
        return step

    def record_input(self, step: Step, message: Input) -> None:
        """The input of a step, which has none yet; a step that was predicted with the input box is done again."""
        step.input = self.inputs[message.step] = message
        self._newest_input = max(self._newest_input, message.step)
        if self._gives_up_inputs:
            self._gives_up_inputs, self._lost_before = False, max(self._lost_before, message.step)
        if self.current is not None and message.step < self.current:
            self.do_again(message.step, step)
            if self._acts_late and message.step + 1 < self.current:  # the input before may still act in a step
                self.do_again(message.step + 1, self.step(message.step + 1))
        for k in self._saw_box.pop(message.step, ()):
            if self.current is not None and self.is_over(k):
                self.do_again(k, self.step(k))

    def give_up_inputs(self) -> None:
        """Inputs have been lost on this side: those that are missing before the next one that comes do not come."""
        self._gives_up_inputs = True

    def sees_box(self, k: int, j: int) -> None:
        """Data of step k have seen the input box in place of the input of step j: when that comes, k is done again."""
        self._saw_box.setdefault(j, set()).add(k)

    def arrived(self, k: int, source: str) -> Message | None:
        """What a source has sent for step k, as far as it is remembered."""
        return self._steps[k].arrived.get(source) if k in self._steps else None

    def untimed(self, k: int, sensor: str) -> Measurement | None:
        """What a sensor has sent for step k without a time of its own, as far as it is remembered."""
        return self._steps[k].untimed(sensor) if k in self._steps else None

    # -- steps

    def step(self, k: int) -> Step:
        """The record of step k."""
        return self._steps.setdefault(k, Step())

    def steps(self) -> list[tuple[int, Step]]:
        """All steps that are remembered, in order."""
        return sorted(self._steps.items())

    def is_published(self, k: int) -> bool:
        """Whether step k was published before."""
        return k in self._steps and self._steps[k].published is not None

    def is_over(self, k: int) -> bool:
        """Whether the data of step k are in the set, or would have been."""
        assert self.current is not None
        return k < self.current or (k == self.current and self.is_combined)

    def is_behind(self) -> bool:
        """Whether so many steps are waiting that intermediate results are no use to anybody."""
        assert self.current is not None
        return self.arrivals.newest - self.current > (BEHIND_LATE if self.is_late else BEHIND)

    def has_input(self, k: int) -> bool:
        """Whether the input of step k has come."""
        return k in self._steps and self._steps[k].input is not None

    def input_is_lost(self, k: int) -> bool:
        """Whether the input of step k has left its publisher's cache, so that waiting for it makes no sense."""
        if self.current is None:
            return False
        if k < self._lost_before and not self.has_input(k):
            return True
        return self._newest_input - k > self._input_lost or len(self._steps) > self._max_steps

    def last_lost_input(self, k: int) -> int:
        """The last step, from k on, whose input is lost, as that of step k is: of its hole, or of a later one.

        A hole is a run of steps without input that ends before one that has it; whoever starts again goes behind all
        of them in one jump.
        """
        last = k
        for j in range(k + 1, self._newest_input):
            if not self.has_input(j) and (last == j - 1 or self.input_is_lost(j)):
                last = j
        return last

    # -- moving

    def begin(self, k: int) -> None:
        """Be at step k, before its data; nothing before it is remembered."""
        self.current, self.is_combined = k, False
        self._forget_steps_before(k)
        self.step(k).origin = None

    def advance(self) -> None:
        """To the next step."""
        assert self.current is not None
        k = self.current
        self.current, self.is_combined = k + 1, False
        self._forget(k - self._remembered)  # one step forward, one is forgotten: never a search of the backlog
        self.arrivals.forget_before(k + 1 - self._history)

    def do_again(self, k: int, step: Step) -> None:
        """Mark a step that is over; one from before the start was never done, and must not hide a later one."""
        if step.before is not None:
            self._dirty = k if self._dirty is None else min(self._dirty, k)

    def take_dirty(self) -> int | None:
        """The earliest step that has to be done again, once."""
        dirty, self._dirty = self._dirty, None
        return dirty

    def rewind(self, k: int) -> Step | None:
        """Be at step k again, before its data; None, and nothing changes, where its set is not remembered."""
        step = self._steps.get(k)
        if step is None or step.before is None:
            return None
        self.current, self.is_combined = k, False
        return step

    def never_rewind(self) -> None:
        """The sets before now must not be used again."""
        for step in self._steps.values():
            step.before = step.origin = None

    def leave(self, first: int, since: int) -> None:
        """Be nowhere, as a peer that has listened since then, and forget what is before a step."""
        self._forget_steps_before(first)
        self.current, self._dirty, self.first_evidence = None, None, since

    def _forget_steps_before(self, k: int) -> None:
        for old in [j for j in self._steps if j < k]:
            self._forget(old)

    def _forget(self, k: int) -> None:
        self._steps.pop(k, None)
        self.inputs.pop(k, None)
        self._saw_box.pop(k, None)
