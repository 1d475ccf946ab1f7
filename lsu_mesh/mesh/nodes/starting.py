"""Where an estimating node starts: at the prior, at a sound set of the mesh, or at the domain; and where again.

It never starts from a guess: where nothing surely holds the state, it waits and says for what.
"""

from __future__ import annotations

from abc import abstractmethod

from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.held_set import HeldSet
from lsu_mesh.mesh.estimation.message_fields import density_of
from lsu_mesh.mesh.estimation.timeline import Timeline
from lsu_mesh.mesh.messages import Base, Message, Posterior, Reference
from lsu_mesh.mesh.nodes.node import SECOND, Node
from lsu_mesh.mesh.nodes.source_timeout import input_key, start_keys
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.mesh.time_requirements import check_times
from lsu_mesh.supports.support import Support

START_GRACE = SECOND // 2
"""How long a late joiner listens to the past before it chooses where to start."""


class StartingNode(Node):
    """A node with one held set and a record of steps, before it does any of them."""

    def __init__(
        self, configuration: Configuration, name: str, boot: str, engine: Filter, sources: tuple[str, ...]
    ) -> None:
        super().__init__(configuration, name, boot)
        check_times(configuration, self.role, name)
        self.sources = sources
        self.held = HeldSet(configuration, engine, f"{self.role}/{name}", boot)
        replaces_inputs = engine.model.domain is not None or configuration.input_box is not None
        self.needs_all_inputs = self.role == "filter" and engine.model.input_count > 0 and not replaces_inputs
        self.timeline = Timeline(configuration, self.history, self.remembered)
        self._candidate: Posterior | None = None
        self._waiting = ""
        self._counts: dict[str, float] = dict.fromkeys(("late", "rewinds", "contradictions", "behind", "resets"), 0)
        self._remarks: list[Message] = []
        """Events of a time update."""

    @property
    @abstractmethod
    def history(self) -> int:
        """How many steps back a late message may rewind."""

    @property
    def remembered(self) -> int:
        """How many steps back inputs are kept, so that all of ``history`` can be done again."""
        return self.history

    @property
    def engine(self) -> Filter:
        """The filter that holds the set."""
        return self.held.engine

    @property
    def current(self) -> int | None:
        """The step that the estimator is at; None before it has started."""
        return self.timeline.current

    def take_candidate(self, message: Posterior) -> None:
        """Note a sound set of the mesh from which a late joiner may start."""
        if message.src == f"{self.role}/{self.name}":
            self.held.epochs.continue_from(message.epoch)
        if message.status in ("ok", "predicted") and (self._candidate is None or message.step > self._candidate.step):
            self._candidate = message

    def _start(self, now: int) -> bool:
        """Choose the first step and the set that surely holds its state."""
        evidence = self.timeline.first_evidence
        if evidence is None:
            return False
        first = self.timeline.steps()[0][0]
        if first > 1 and now < evidence + START_GRACE:
            return False
        if (first == 1 and self._start_from_prior(1)) or self._start_from_candidate() or self._start_from_prior(first):
            return True
        domain = self.engine.model.domain
        if domain is not None:
            self._begin(first, domain, "domain")
            return True
        missing = next((j for j in range(1, first + 1) if self._input_missing(j)), first)
        inputs = f"the inputs since step {missing} ({input_key(self.configuration)})"
        self._waiting = f"a sound set to start from ({start_keys(self)}), or {inputs}"
        return False

    def _start_from_candidate(self) -> bool:
        candidate = self._candidate
        if candidate is None or self.held.epochs.is_abandoned(candidate) or self._input_missing(candidate.step):
            return False
        try:
            self._begin(candidate.step, to_support(candidate.support), candidate.reference)
            if candidate.src == f"{self.role}/{self.name}" and (density := density_of(candidate)) is not None:
                self.engine.take_density(density)
        except InconsistentData:  # it is empty: whoever sent it was wrong
            self._candidate = None
            return False
        self.held.add_dependency(candidate)
        return True

    def _start_from_prior(self, first: int) -> bool:
        if any(self._input_missing(j) for j in range(1, first)):
            return False
        self._begin(1, self.configuration.prior, "prior", restarted=False)
        self.held.reach.begin(self.configuration.prior)
        return True

    def _input_missing(self, k: int) -> bool:
        if self.engine.model.input_count == 0 or self.configuration.input_box is not None:
            return False
        return not self.timeline.has_input(k)

    def _begin(self, k: int, support: Support, base: Base, *, restarted: bool = True) -> None:
        """Begin at step k, with a set that surely holds its state; ``restarted``: in the middle of a run."""
        self.held.begin(support, base, restarted=restarted)
        self._waiting = ""
        self.timeline.begin(k)

    def _start_over(self, k: int, why: str, now: int) -> None:
        """Nothing is known behind step k: join again there, like a peer that starts late."""
        self.join_again(k + 1, now)
        self._counts["resets"] += 1
        text = f"{why}; starting again behind it"
        self._remarks.append(self.event("ERROR", "started-over", text, now=now, step=k, about={"step": k}))

    def join_again(self, first: int, since: int) -> None:
        """Forget what is before a step and start from there, as a peer that has listened since then."""
        self.timeline.leave(first, since)
        self._candidate = None
        self.held.reach.lose()

    def start_without_data(self, k: int, *, abandons: bool) -> bool:
        """Hold what holds the state of step k whatever was measured; False, and nothing changes, without any."""
        start = self.held.start_without_data(k)
        if start is None:
            return False
        support, base, used = start
        self.engine.reset(support)
        if abandons:
            self.abandon_epoch("")
        self.start_from(base, used)
        return True

    def abandon_epoch(self, why: str) -> None:
        """Tell all who relied on the own sets not to; ``why`` the engine holds nothing that may be believed now."""
        self.held.abandon_epoch(why)
        self._counts["resets"] += 1
        self.timeline.never_rewind()

    def start_from(self, base: Base, used: tuple[Reference, ...] = ()) -> None:
        """Note that the engine now holds a set made from ``base`` and ``used`` alone."""
        self.held.start_from(base, used)
        self.timeline.never_rewind()
