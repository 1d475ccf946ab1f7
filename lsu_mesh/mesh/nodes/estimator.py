"""The common course of filter and fusion nodes: steps in order, waiting, rewinding, republishing.

At each step the node collects what its sources send, combines it when all have come or the deadline has passed,
publishes, and predicts with the input. What comes late rewinds to its step. A missing input is never guessed.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, UnboundedSupport
from lsu_mesh.filters.filter import Filter
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.epochs import Epochs
from lsu_mesh.mesh.estimation.open_loop import OpenLoop
from lsu_mesh.mesh.estimation.step_arrivals import StepArrivals
from lsu_mesh.mesh.estimation.step_record import Base, Combined, Step, published_content
from lsu_mesh.mesh.estimation.warm_up import warm_up
from lsu_mesh.mesh.messages import (
    Bounds,
    Guarantee,
    Input,
    Message,
    Posterior,
    Prediction,
    Reference,
    SupportMessage,
)
from lsu_mesh.mesh.nodes.node import SECOND, Complaint, Node
from lsu_mesh.mesh.nodes.source_timeout import SourceTimeouts, input_key, start_keys
from lsu_mesh.mesh.sets import to_message, to_support
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

About = dict[str, str | int | float | None]
START_GRACE = SECOND // 2
"""How long a late joiner listens to the past before it chooses where to start."""
BEHIND = 32
"""So many complete steps in the queue and intermediate results are no longer published."""
INPUT_LOST = 256
"""So many later inputs have come, and so many that their publisher keeps no more of them: this one does not come."""
MAX_STEPS = 4096
"""Steps that are remembered while something is waited for, or twice those that publishers keep where these are more."""
MAX_AT_ONCE = 1024
"""Steps done in one tick, the next tick goes on; more only where more than this would be left."""
MAX_MESSAGES = 32
"""So much to publish and a tick ends, the next tick goes on: nobody waits for the first until the last is done."""
MAX_USED = 2048
"""So many references since the last publication and a step is published all the same: receivers refuse longer lists."""
WEAKNESS: tuple[Guarantee, ...] = ("declared", "learned", "none")


class Estimator(Node):
    """A node that holds one set per step."""

    def __init__(
        self, configuration: Configuration, name: str, boot: str, engine: Filter, sources: tuple[str, ...]
    ) -> None:
        super().__init__(configuration, name, boot)
        self.engine = engine
        self.sources = sources
        self.epochs = Epochs(f"{self.role}/{name}", boot)
        self.current: int | None = None
        self._combined = False
        """Whether the data of the current step are in the set."""
        self._steps: dict[int, Step] = {}
        self._newest_input = 0
        self._step_arrivals = StepArrivals(configuration.mesh.rate / SECOND)
        self._source_timeouts = SourceTimeouts(configuration, self.subscriptions(), sources)
        self._has_more = False
        """Whether the last tick has left steps that may be ready."""
        self._most_steps = max(MAX_STEPS, 2 * configuration.cached)
        self._first_evidence: int | None = None
        self._candidate: Posterior | None = None
        self._base: Base = "prior"
        self._used: tuple[Reference, ...] = ()
        """Everything used since ``_base``."""
        self._dirty: int | None = None
        """Earliest step that has to be done again."""
        self._waiting = ""
        self._restarted = False
        self._counts: dict[str, float] = {
            "late": 0, "rewinds": 0, "contradictions": 0, "behind": 0, "resets": 0, "from the future": 0,
        }  # fmt: skip
        self.best_guarantee: Guarantee = engine.guarantee
        """No set of the node is better than this."""
        self.guarantee: Guarantee = self.best_guarantee
        """The weakest guarantee among all that the set descends from."""
        self._remarks: list[Message] = []
        """Events of a time update."""
        self.unsound = ""
        """Why the set that is held must not be believed; empty where it may."""
        self.reach = OpenLoop(engine.model)
        """The prior carried through every input: from here one can always start again."""
        self.last_posterior: Posterior | None = None
        self.absent: set[str] = set()
        """Sources that are known to be gone and are not waited for."""

    # -- what differs between filter and fusion

    @property
    @abstractmethod
    def deadline(self) -> int:
        """How long to wait for a step's sources after its first sign, in nanoseconds."""

    @property
    @abstractmethod
    def history(self) -> int:
        """How many steps back a late message may rewind."""

    @property
    def remembered(self) -> int:
        """How many steps back inputs are kept, so that all of ``history`` can be done again."""
        return self.history

    @abstractmethod
    def combine(self, k: int, step: Step, now: int) -> tuple[Combined, list[Message]]:
        """Bring the step's data into the engine's set; also events."""

    @abstractmethod
    def posterior(self, k: int, step: Step, combined: Combined, support: SupportMessage, now: int) -> Posterior:
        """The message about the set after the data."""

    def published_bounds(self) -> tuple[Vector, Vector]:
        """Bounds of the set after the data, as they are published."""
        return self.engine.bounds()

    def prediction(self, k: int, now: int) -> list[Message]:
        """Messages about the set before the data of step k."""
        return []

    # -- messages in

    def take(self, source: str, message: Message, now: int) -> None:
        """Note a source's message for its step; a step that is over will be done again."""
        self._source_timeouts.received(source, now)
        step = self._see(message.step, now)
        if step is None:
            self._counts["late"] += 1
            return
        step.arrived[source] = message
        if self.current is not None and self._is_over(message.step):
            self._counts["late"] += 1
            self._do_again(message.step, step)

    def _do_again(self, k: int, step: Step) -> None:
        """Mark a step that is over; one from before the start was never done, and must not hide a later one."""
        if step.before is not None:
            self._dirty = k if self._dirty is None else min(self._dirty, k)

    def arrived(self, k: int, source: str) -> Message | None:
        """What the source has sent for step k, as far as it is remembered."""
        return self._steps[k].arrived.get(source) if k in self._steps else None

    def take_input(self, message: Input, now: int) -> list[Message]:
        """Note an input; the first of a step counts."""
        step = self._see(message.step, now)
        if step is None:
            return []
        if step.input is None:
            step.input = message
            self._newest_input = max(self._newest_input, message.step)
            if self.current is not None and message.step < self.current:  # the input box stood in for it
                self._do_again(message.step, step)
        elif step.input.u != message.u:
            about: About = {"source": message.src, "step": message.step}
            text = f"input of step {message.step} came again from {message.src} with another value; the first counts"
            return [self.event("WARN", "input-changed", text, now, message.step, about)]
        return []

    def take_candidate(self, message: Posterior) -> None:
        """Note a sound set of the mesh from which a late joiner may start."""
        if message.src == f"{self.role}/{self.name}":
            self.epochs.continue_from(message.epoch)
        if message.status in ("ok", "predicted") and (self._candidate is None or message.step > self._candidate.step):
            self._candidate = message

    def add_dependency(self, message: Posterior | Prediction) -> None:
        """Note that a message's set went into the own one, with its epochs and its guarantee."""
        self.epochs.add_dependency(message)
        self.downgrade_guarantee(message.guarantee)

    def downgrade_guarantee(self, guarantee: Guarantee) -> None:
        """The set is from now on no better than this."""
        self.guarantee = max(self.guarantee, guarantee, key=WEAKNESS.index)

    def inputs(self) -> dict[int, Input]:
        """The inputs that are remembered, by step."""
        return {k: step.input for k, step in self._steps.items() if step.input is not None}

    def _see(self, k: int, now: int) -> Step | None:
        """The record of step k, or None when it lies before all that is remembered."""
        if self.current is not None and k < self.current - self.history:
            return None
        if self.current is not None and self._step_arrivals.is_from_the_future(k, now):
            self._counts["from the future"] += 1
            return None
        self._step_arrivals.record(k, now)
        if self._first_evidence is None:
            self._first_evidence = now
        step = self._steps.setdefault(k, Step())
        if len(self._steps) > self._most_steps and self.current is None:
            del self._steps[min(self._steps)]
        return step

    def _is_over(self, k: int) -> bool:
        assert self.current is not None
        return k < self.current or (k == self.current and self._combined)

    # -- the course of steps

    def advance(self, now: int) -> list[Message]:
        if self._dirty is not None:
            self._rewind(self._dirty)
            self._dirty = None
        self._has_more = False
        if self.current is None and not self._start(now):
            return []
        messages: list[Message] = []
        for left in reversed(range(self._steps_at_once())):
            assert self.current is not None
            k = self.current
            step = self._steps.setdefault(k, Step())
            if not self._combined:
                if not self._is_ready(k, step, now):
                    break
                messages += self._close(k, step, now)
            if not self._predict(k, step, now):
                if self._input_is_lost(k):
                    self._start_over(k, f"the input of step {k} is lost", now)
                break
            messages += self._take_remarks()
            if step.published is not None and not self.unsound and not self._is_behind():
                messages += self.prediction(k + 1, now)
            self._has_more = left == 0 or (len(messages) >= MAX_MESSAGES and not self._is_done_again(k + 1))
            if self._has_more:
                break
        return messages + self._take_remarks()

    def _steps_at_once(self) -> int:
        """A backlog stays bounded whatever comes: what is too much waits in the queue in front of the node."""
        assert self.current is not None
        return max(MAX_AT_ONCE, self._step_arrivals.newest - self.current - MAX_AT_ONCE)

    def _is_done_again(self, k: int) -> bool:
        """Whether the step was published before: all that a late message changes is told in one tick."""
        return k in self._steps and self._steps[k].published is not None

    def _is_ready(self, k: int, step: Step, now: int) -> bool:
        if step.closed or all(name in step.arrived or name in self.absent for name in self.sources):
            return bool(step.closed or step.arrived or self._step_arrivals.newest > k)
        return self._is_overdue(k, now)

    def _is_overdue(self, k: int, now: int) -> bool:
        sign = self._step_arrivals.of(k)
        return sign is not None and now >= sign + self.deadline

    def wakeup(self) -> int | None:
        if self._has_more:
            return 0
        if self.current is None:
            return None if self._first_evidence is None else self._first_evidence + START_GRACE
        sign = self._step_arrivals.of(self.current)
        waits = not self._combined or self.configuration.input_box is not None
        return sign + self.deadline if sign is not None and waits else None

    def _is_behind(self) -> bool:
        assert self.current is not None
        return self._step_arrivals.newest - self.current > BEHIND

    def _close(self, k: int, step: Step, now: int) -> list[Message]:
        """Combine the step's data and publish the result if it is new."""
        step.before, step.base, step.used_before = self.engine.snapshot(), self._base, self._used
        step.reach = self.reach.snapshot()
        combined, messages = self.combine(k, step, now)
        step.closed = True
        self._combined = True
        if self._restarted and combined.status != "inconsistent":
            combined = replace(combined, status="restarted")
            self._restarted = False
        self._used = (*self._used, *combined.used)
        is_first = step.published is None
        # a base that is no message does not say its step: the first posterior since then is always published
        tells_step = self._base == "prior" or not isinstance(self._base, str)
        may_skip = combined.status in ("ok", "predicted") and len(self._used) < MAX_USED and tells_step
        if self.unsound and self.last_posterior is None:
            return messages
        if is_first and self._is_behind() and may_skip:
            self._counts["behind"] += 1
            return messages
        posterior = self._publish(k, step, combined, now)
        return messages if posterior is None else [*messages, posterior]

    def _publish(self, k: int, step: Step, combined: Combined, now: int) -> Posterior | None:
        """The posterior's message, or None when the step was published before with the same set and sources."""
        support, old = to_message(self.engine.support), step.published
        box = tuple(bound.tolist() for bound in self.published_bounds())
        told = (support, box, combined.status, self.epochs.number, self.guarantee, list(combined.missing))
        if old is not None and told == published_content(old):
            self._base, self._used = old.reference, ()
            return None
        step.revision += 1
        combined = replace(combined, used=self._used)
        posterior = step.published = self.posterior(k, step, combined, support, now)
        self._base, self._used = posterior.reference, ()
        if posterior.status != "inconsistent":
            self.last_posterior = posterior
        return posterior

    def _predict(self, k: int, step: Step, now: int) -> bool:
        """Time update to step k + 1; False where the input is still missing."""
        u: Vector | Orthotope | None = None
        if self.engine.model.input_count:
            if step.input is not None:
                u = np.array(step.input.u)
            elif self.configuration.input_box is not None and self._is_overdue(k, now):
                u = self.configuration.input_box
            else:
                self._waiting = (
                    f"input of step {k} ({input_key(self.configuration)})" if self._step_arrivals.newest > k else ""
                )
                return False
        self._waiting = ""
        if step.input is not None:
            self._used = (*self._used, step.input.reference)
        self.reach.predict(u)
        if not self._predict_set(k, u, now):
            return False
        self.current, self._combined = k + 1, False
        self._steps.pop(k - self.remembered, None)  # one step forward, one is forgotten: never a search of the backlog
        self._step_arrivals.forget_before(k + 1 - self.history)
        return True

    def _predict_set(self, k: int, u: Vector | Orthotope | None, now: int) -> bool:
        """Time update of the set; one that leaves the domain was wrong, one that outgrows all numbers says nothing."""
        try:
            self.engine.predict(u)
        except (InconsistentData, UnboundedSupport) as error:
            words = f"the prediction from step {k} failed: {error}"
            start = self.start_without_data()
            if start is None:
                self._start_over(k, words, now)
                return False
            self.engine.reset(start[0])
            self.begin_epoch(start[1])
            about: About = {"step": k, "epoch": self.epochs.number}
            self._remarks.append(self.event("ERROR", "reset", words, now, k, about))
        return True

    def start_without_data(self) -> tuple[Orthotope, Base] | None:
        """What holds the state of the current step whatever was measured: the prior carried forward, or the domain."""
        reach, domain = self.reach.box, self.engine.model.domain
        if reach is not None:
            return reach, "reach"
        return None if domain is None else (domain, "domain")

    def _take_remarks(self) -> list[Message]:
        said, self._remarks = self._remarks, []
        return said

    def _input_is_lost(self, k: int) -> bool:
        """Whether the input of step k has left its publisher's cache, so that waiting for it makes no sense."""
        if self.current is None:
            return False
        later = self._newest_input - k
        return later > max(INPUT_LOST, self.configuration.cached) or len(self._steps) > self._most_steps

    def _start_over(self, k: int, why: str, now: int) -> None:
        """Nothing is known behind step k: join again there, like a peer that starts late."""
        self.join_again(k + 1, now)
        self._counts["resets"] += 1
        text = f"{why}; starting again behind it"
        self._remarks.append(self.event("ERROR", "started-over", text, now, k, {"step": k}))

    def join_again(self, first: int, since: int) -> None:
        """Forget what is before a step and start from there, as a peer that has listened since then."""
        for old in [j for j in self._steps if j < first]:
            del self._steps[old]
        self.current, self._dirty, self._candidate, self._first_evidence = None, None, None, since
        self.reach.lose()

    def _rewind(self, k: int) -> None:
        """Return to the set before the data of step k, so that everything since is done again."""
        step = self._steps.get(k)
        if step is None or step.before is None:
            return
        self._counts["rewinds"] += 1
        self.engine.restore(step.before)
        self.reach.restore(step.reach)
        self.current, self._combined = k, False
        self._base, self._used = step.base, step.used_before

    # -- where to start

    def _start(self, now: int) -> bool:
        """Choose the first step and the set that surely holds its state."""
        if self._first_evidence is None:
            return False
        first = min(self._steps)
        if first > 1 and now < self._first_evidence + START_GRACE:
            return False
        if (first == 1 and self._start_from_prior(1)) or self._start_from_candidate() or self._start_from_prior(first):
            return True
        domain = self.engine.model.domain
        if domain is not None:
            self._begin(first, domain, "domain", restarted=True)
            return True
        missing = next((j for j in range(1, first + 1) if self._input_missing(j)), first)
        inputs = f"the inputs since step {missing} ({input_key(self.configuration)})"
        self._waiting = f"a sound set to start from ({start_keys(self)}), or {inputs}"
        return False

    def _start_from_candidate(self) -> bool:
        candidate = self._candidate
        if candidate is None or self.epochs.is_abandoned(candidate) or self._input_missing(candidate.step):
            return False
        try:
            self._begin(candidate.step, to_support(candidate.support), candidate.reference, restarted=True)
        except InconsistentData:  # it is empty: whoever sent it was wrong
            self._candidate = None
            return False
        self.add_dependency(candidate)
        return True

    def _start_from_prior(self, first: int) -> bool:
        if any(self._input_missing(j) for j in range(1, first)):
            return False
        self._begin(1, self.configuration.prior, "prior", restarted=False)
        self.reach.begin(self.configuration.prior)
        return True

    def _input_missing(self, k: int) -> bool:
        if self.engine.model.input_count == 0 or self.configuration.input_box is not None:
            return False
        return k not in self._steps or self._steps[k].input is None

    def _begin(self, k: int, support: Support, base: Base, *, restarted: bool) -> None:
        self.engine.reset(support)
        self.current, self._combined, self._restarted = k, False, restarted
        self._base, self._used, self._waiting, self.unsound = base, (), "", ""
        self.reach.lose()
        for old in [j for j in self._steps if j < k]:
            del self._steps[old]

    def begin_epoch(self, base: Base) -> None:
        """Note that the engine now holds a set made from ``base`` alone; what was before is never used again."""
        self.abandon_epoch("")
        self.start_from(base)

    def abandon_epoch(self, why: str) -> None:
        """Tell all who relied on the own sets not to; ``why`` the engine holds nothing that may be believed now."""
        self.epochs.begin()
        self._counts["resets"] += 1
        self.unsound = why
        self._never_rewind()

    def start_from(self, base: Base, used: Sequence[Reference] = ()) -> None:
        """Note that the engine now holds a set made from ``base`` and ``used`` alone."""
        self.guarantee, self.unsound = self.best_guarantee, ""
        self._base, self._used, self._restarted = base, tuple(used), True
        self._never_rewind()

    def _never_rewind(self) -> None:
        for step in self._steps.values():
            step.before = None

    def warm_up(self) -> None:
        warm_up(self.engine, self.configuration.input_box)

    # -- what is said of the node

    def step(self) -> int:
        return self.current or 0

    def waiting_for(self) -> str:
        return self._waiting

    def complaints(self, now: int) -> list[Complaint]:
        """As of every node, how far it is behind, and which sources have fallen silent."""
        found = super().complaints(now)
        if self.current is not None and self._is_behind():
            late, unpublished = self._step_arrivals.newest - self.current, self._counts["behind"]
            text = f"behind by {late} steps; {unpublished:g} steps so far were done without being published"
            found.append(Complaint("WARN", text))
        last = self.configuration.mesh.steps
        has_ended = last is not None and self._step_arrivals.newest >= last  # nobody has anything to say any more
        is_early = self._first_evidence is None
        return found + ([] if has_ended or is_early else self._source_timeouts.complaints(now))

    def counters(self) -> dict[str, float]:
        return self._counts | {"epoch": self.epochs.number, "newest": self._step_arrivals.newest}

    def noise_bounds(self) -> Bounds:
        """rho and r in force."""
        return Bounds(rho=self.engine.model.rho.tolist(), r=self.engine.model.r.tolist())
