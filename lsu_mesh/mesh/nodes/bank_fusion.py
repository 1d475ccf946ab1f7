"""A fusion of banks as a node: the posteriors of one step of all banks in, their common boxes out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.mesh.access import published_topics, subscriptions
from lsu_mesh.mesh.bank_messages import INCONSISTENT, BankFused, BankPosterior
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.estimation.bank_answer import fused_of
from lsu_mesh.mesh.estimation.bank_fusion_step import fuse_banks
from lsu_mesh.mesh.messages import Fused, Message
from lsu_mesh.mesh.nodes.bank_course import BankCourse
from lsu_mesh.mesh.nodes.node import SECOND, About


class BankFusionNode(BankCourse[BankPosterior]):
    """Intersects what the banks say of each step; it holds no sets of its own, and so has nothing to start from."""

    role = "fusion"

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        self.settings = configuration.fusion[name]
        self.publishes = published_topics(configuration, self.role, name)
        super().__init__(configuration, name, boot, self.settings.sources)
        self._known: set[int] = set()
        """Instances whose boxes had no common point in the step before."""
        self._counts["contradictions"] = 0.0
        self.last: BankFused | None = None
        self.last_of: dict[str, BankPosterior] = {}
        """The newest posterior of each source, from which a bank that starts again may start."""

    @property
    def deadline(self) -> int:
        return int(self.settings.deadline * SECOND)

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return subscriptions(self.configuration, self.role, self.name)

    def receive(self, message: Message, now: int) -> list[Message]:
        if isinstance(message, BankPosterior):
            known = self.last_of.get(message.name)
            if known is None or message.step > known.step:
                self.last_of[message.name] = message
            self.take(message, now)
        return []

    def one(self, message: BankFused, instance: int) -> Fused:
        """The fused set of one instance in a message of the fusion."""
        return fused_of(self.configuration, message, instance)

    def first_step(self, oldest: int) -> int:
        return oldest

    def close(self, k: int, arrived: dict[str, BankPosterior], now: int) -> list[Message]:
        """The fused boxes of step k; nothing where no source has published it."""
        if not arrived:
            return []
        sources = [arrived[name] for name in self.sources if name in arrived]
        stamp = self.stamp("bank_fused", k, now, min(one.origin_ns for one in sources))
        missing = [name for name in self.sources if name not in arrived]
        self.last = fused = BankFused(**stamp, **fuse_banks(sources), missing=missing)
        believed = np.array([one.status_codes != INCONSISTENT for one in sources]).any(axis=0)
        disjoint = set(np.flatnonzero((fused.status_codes == INCONSISTENT) & believed).tolist())
        self._counts["contradictions"] += len(disjoint)
        fresh, self._known = sorted(disjoint - self._known), disjoint
        if not fresh:
            return [fused]
        about: About = {"step": k, "instances": len(fresh), "first": fresh[0]}
        text = f"step {k}: the boxes of {len(fresh)} instance(s) have no common point, the first is {fresh[0]}"
        return [fused, self.event("ERROR", "contradiction", text, now=now, step=k, about=about)]
