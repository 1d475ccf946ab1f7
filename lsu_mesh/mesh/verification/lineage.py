"""What a set descends from: its guarantee and its descent, recomputed from its base and from what it used.

A set is worth the weakest of its kind, its base and all that was brought to it, and descends from the epochs of all of
these. Nothing that the set says of itself is believed: a set whose base is not in the recording has no proved
guarantee.
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.epochs import Epochs
from lsu_mesh.mesh.estimation.fusion_step import OUTVOTED, fused_guarantee
from lsu_mesh.mesh.estimation.guarantee import declared_guarantee
from lsu_mesh.mesh.estimation.held_set import weakest
from lsu_mesh.mesh.messages import Fused, Guarantee, Mark, Message, Posterior, Prediction, Reference, Suggestion
from lsu_mesh.mesh.verification.archive import Archive, DoesNotFit, Unverifiable
from lsu_mesh.mesh.verification.recomputed import Recomputed

Set = Posterior | Prediction
NOT_THERE = "what it was made from is not in the recording"
OLDER_PEER = "an older peer kept it when a late message took it back a step"
MAYBE_WIDENED = "whether r was widened is told by another algorithm only"


class Worth(NamedTuple):
    """What a set is worth, and what it descends from."""

    guarantee: Guarantee | None
    """``None`` where it cannot be told."""
    descent: list[Mark]


class Lineage:
    """Recomputes guarantee and descent, one set after another, each after what it was made from."""

    def __init__(self, configuration: Configuration, archive: Archive) -> None:
        self._configuration = configuration
        self._archive = archive
        self._proved: dict[Reference, Guarantee] = {}
        self._adopted: dict[tuple[str, str], int] = {}
        """By process, the first epoch that goes by learned bounds."""
        for message in archive.messages(Posterior):
            if any(reference[0] == Suggestion.topic for reference in message.used):
                first = self._adopted.get((message.src, message.boot), message.epoch)
                self._adopted[message.src, message.boot] = min(first, message.epoch)
        self._claimed: defaultdict[tuple[str, str], set[Guarantee]] = defaultdict(set)
        self._marks: defaultdict[tuple[str, str], set[Mark]] = defaultdict(set)

    def proved(self, reference: Reference) -> Guarantee | None:
        """The guarantee that a set has by all that it descends from; ``None`` where that is not in the recording."""
        return self._proved.get(reference)

    def check(self, message: Set, recomputed: Recomputed | None) -> tuple[dict[str, object], list[str]]:
        """Claims that are false, with what they should be; and what cannot be proved, by name."""
        try:
            by_claims = self._worth(message, recomputed, proved=False)
        except (Unverifiable, DoesNotFit):
            return {}, [f"guarantee: {NOT_THERE}", f"descent: {NOT_THERE}"]
        by_proof = self._prove(message, recomputed)
        false: dict[str, object] = {}
        unproved: list[str] = []
        process = message.src, message.boot
        kept = message.guarantee in self._claimed[process] if message.algorithm is None else False
        if by_claims.guarantee is None:
            unproved.append(f"guarantee: {MAYBE_WIDENED}")
        elif message.guarantee not in (by_claims.guarantee, by_proof):
            if kept:
                unproved.append(f"guarantee: {OLDER_PEER}")
            else:
                false["guarantee"] = by_claims.guarantee
        if message.descent != by_claims.descent:
            known = self._marks[process].union(by_claims.descent)
            if message.algorithm is None and known.issuperset(message.descent):
                unproved.append(f"descent: {OLDER_PEER}")
            else:
                false["descent"] = by_claims.descent
        self._claimed[process].add(message.guarantee)
        self._marks[process].update(message.descent)
        return false, unproved

    def _prove(self, message: Set, recomputed: Recomputed | None) -> Guarantee | None:
        """The guarantee by what is proved of all that a set was made from."""
        try:
            proved = self._worth(message, recomputed, proved=True).guarantee
        except Unverifiable:
            return None
        if proved is not None:
            self._proved[message.reference] = proved
        return proved

    # -- what a set is worth

    def _worth(self, message: Set, recomputed: Recomputed | None, *, proved: bool) -> Worth:
        """By what is claimed of the sets that it was made from, or by what is proved of them."""
        epochs = Epochs(message.src, message.boot)
        found = [self._best(message)]
        base = self._base(message)
        if base is not None:
            is_own = (base.src, base.boot) == (message.src, message.boot)
            found.append(self._guarantee_of(base, proved=proved))
            if not is_own:
                epochs.add_dependency(base)
            elif base.epoch == message.epoch:
                epochs.restore({(src, boot): number for src, boot, number in base.descent})
        if isinstance(message, Fused):
            found += self._of_sources(message, epochs, proved=proved)
        elif isinstance(message, Posterior):
            found += self._of_transfers(message, epochs, proved=proved)
            if recomputed is None and self._may_widen(message):
                return Worth(None, epochs.descent)
            if recomputed is not None and recomputed.is_widened:
                found.append("learned")
        return Worth(weakest(found), epochs.descent)

    def _may_widen(self, message: Posterior) -> bool:
        return self._configuration.filters[message.name].on_inconsistency == "widen"

    def _best(self, message: Set) -> Guarantee:
        """What a peer's sets are worth at best."""
        if isinstance(message, Fused):
            return "declared"
        first = self._adopted.get((message.src, message.boot))
        best = declared_guarantee(self._configuration, self._configuration.filters[message.name])
        return best if first is None or message.epoch < first else weakest((best, "learned"))

    def _base(self, message: Set) -> Posterior | None:
        """The message that a set was made from; ``None`` where it was made from something else."""
        if isinstance(message, Prediction) and message.base is None:
            return self._archive.posterior_before(message)
        return self._archive.find(message.base, Posterior) if isinstance(message.base, tuple) else None

    def _guarantee_of(self, message: Set, *, proved: bool) -> Guarantee:
        if not proved:
            return message.guarantee
        if message.reference not in self._proved:
            raise Unverifiable(NOT_THERE)
        return self._proved[message.reference]

    def _of_transfers(self, message: Posterior, epochs: Epochs, *, proved: bool) -> list[Guarantee]:
        found: list[Guarantee] = []
        for reference in message.used:
            if reference[0] not in (Prediction.topic, Fused.topic):
                continue
            transfer = self._archive.find(reference, Message)
            assert isinstance(transfer, Prediction | Posterior)
            epochs.add_dependency(transfer)
            found.append(self._guarantee_of(transfer, proved=proved))
            if self._configuration.filters[message.name].transfer == "data-predictor":
                found.append("none")
        return found

    def _of_sources(self, message: Fused, epochs: Epochs, *, proved: bool) -> list[Guarantee]:
        """Of each step its sources; a fusion that had to choose among them holds no declared set."""
        policy = POLICIES[self._configuration.fusion[message.name].policy]
        by_step: defaultdict[int, list[Guarantee]] = defaultdict(list)
        for reference in message.used:
            if reference[0] in (Posterior.topic, Fused.topic):
                source = self._archive.find(reference, Posterior)
                by_step[source.step].append(self._guarantee_of(source, proved=proved))
                if policy.is_intersection:
                    epochs.add_dependency(source)
        faults = 0 if policy.is_intersection else self._configuration.fusion[message.name].faults
        found = [fused_guarantee(guarantees, faults) for guarantees in by_step.values()]
        if policy.is_intersection and any(one.reason == OUTVOTED for one in message.rejected):
            found.append("learned")
        return found
