"""The set that an estimator holds, and what may be said of it: what it was made from, what it is worth.

What may be combined is said here alone. A set may be combined with a step's data while it is not ``unsound``. It was
made from its ``base`` and from ``used``, everything brought to it since, in the order applied; publishing makes the
message the next base. It starts from the prior, a sound set of the mesh, the prior carried through every input, the
domain, or the sources of one step alone; each start that leaves a set behind opens an epoch, and nothing from before
is ever used again. A set is worth the weakest of all that it descends from.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.epochs import Epochs
from lsu_mesh.mesh.estimation.open_loop import OpenLoop
from lsu_mesh.mesh.messages import Base, Guarantee, Input, Mark, Posterior, Prediction, Reference
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

WEAKNESS: tuple[Guarantee, ...] = ("declared", "learned", "none")


def weakest(guarantees: Iterable[Guarantee]) -> Guarantee:
    """The weakest of some guarantees, at least one."""
    return max(guarantees, key=WEAKNESS.index)


@dataclass(frozen=True)
class Held:
    """All of a held set at one moment, for going back to it."""

    engine: object
    reach: object
    base: Base
    used: tuple[Reference, ...]
    guarantee: Guarantee
    descent: dict[tuple[str, str], int]


class HeldSet:
    """An engine's set with its provenance, its guarantee and its epochs.

    Parameters
    ----------
    configuration:
        The mesh; where its input box may stand in for an input, a start from the reach lists the inputs that did not
        need it.
    engine:
        The filter whose set it is.
    src, boot:
        Of the process that holds it.
    """

    def __init__(self, configuration: Configuration, engine: Filter, src: str, boot: str) -> None:
        self.engine = engine
        self.epochs = Epochs(src, boot)
        self.reach = OpenLoop(configuration, engine.model, lists_inputs=configuration.input_box is not None)
        """The prior carried through every input: from here one can always start again."""
        self.base: Base = "prior"
        self.used: tuple[Reference, ...] = ()
        """Everything used since ``base``, in the order applied."""
        self.unsound = ""
        """Why the set must not be believed; empty where it may."""
        self.best_guarantee: Guarantee = engine.guarantee
        """No set of the estimator is better than this."""
        self.guarantee: Guarantee = self.best_guarantee
        """The weakest guarantee among all that the set descends from."""
        self.is_restarted = False
        """Whether the next set that is published is the first since a start in the middle of a run."""

    def limit_guarantee(self, guarantee: Guarantee) -> None:
        """No set of the estimator is better than this."""
        self.best_guarantee = weakest((self.best_guarantee, guarantee))
        self.downgrade_guarantee(guarantee)

    @property
    def descent(self) -> list[Mark]:
        """Epochs of others that the set descends from."""
        return self.epochs.descent

    @property
    def tells_step(self) -> bool:
        """Whether ``base`` says of which step it is; the domain, for example, does not."""
        return self.base == "prior" or not isinstance(self.base, str)

    # -- starts

    def begin(self, support: Support, base: Base, *, restarted: bool) -> None:
        """Hold a set from which the estimator begins."""
        self.engine.reset(support)
        self.base, self.used, self.unsound, self.is_restarted = base, (), "", restarted
        self.guarantee = self.best_guarantee
        self.epochs.restore({})
        self.reach.lose()

    def start_from(self, base: Base, used: Iterable[Reference] = ()) -> None:
        """Note that the engine now holds a set made from ``base`` and ``used`` alone."""
        self.guarantee, self.unsound = self.best_guarantee, ""
        self.base, self.used, self.is_restarted = base, tuple(used), True

    def adopt(self, engine: Filter) -> None:
        """Go by learned bounds from now on: another engine, and never better than learned."""
        self.engine = engine
        self.best_guarantee = weakest((self.best_guarantee, "learned"))
        self.reach.lose()

    def abandon_epoch(self, why: str) -> None:
        """Tell all who relied on the own sets not to; ``why`` the engine holds nothing that may be believed now."""
        self.epochs.begin()
        self.unsound = why

    def start_without_data(self, k: int) -> tuple[Orthotope, Base, tuple[Reference, ...]] | None:
        """What holds the state of step k whatever was measured, and the inputs that went into it.

        The prior carried forward, else the domain, else ``None``.
        """
        reach, domain = self.reach.box, self.engine.model.domain
        if reach is not None:
            return reach, "reach", self.reach.inputs_before(k)
        return None if domain is None else (domain, "domain", ())

    # -- what goes into it

    def record_used(self, references: Iterable[Reference]) -> None:
        """Note what was brought to the set."""
        self.used = (*self.used, *references)

    def add_dependency(self, message: Posterior | Prediction) -> None:
        """Note that a message's set went into the own one, with its epochs and its guarantee."""
        self.epochs.add_dependency(message)
        self.downgrade_guarantee(message.guarantee)

    def downgrade_guarantee(self, guarantee: Guarantee) -> None:
        """The set is from now on no better than this."""
        self.guarantee = weakest((self.guarantee, guarantee))

    def record_published(self, posterior: Posterior) -> None:
        """The set is that of a message, from which the next are made."""
        self.base, self.used = posterior.reference, ()

    def predict_reach(self, k: int, u: Drive, earlier: Drive, *, message: Input | None) -> None:
        """Carry the prior on through the input of step k, and note the input's message where it is known."""
        if message is not None:
            self.record_used([message.reference])
        reference, since = (None, None) if message is None else (message.reference, message.time_ns)
        self.reach.predict(u, k, earlier, reference=reference, since=since)

    # -- going back

    def snapshot(self) -> Held:
        """All of it, for :meth:`restore`."""
        descent = self.epochs.snapshot()
        return Held(
            engine=self.engine.snapshot(),
            reach=self.reach.snapshot(),
            base=self.base,
            used=self.used,
            guarantee=self.guarantee,
            descent=descent,
        )

    def restore(self, held: Held) -> None:
        """Hold an earlier set of the same epoch again; the set then descends from what it did."""
        self.engine.restore(held.engine)
        self.reach.restore(held.reach)
        self.base, self.used, self.guarantee = held.base, held.used, held.guarantee
        self.epochs.restore(held.descent)
