"""The fusion policies by name: one entry each. Whoever adds a policy writes one file and one entry here.

``fuse``, the fusion node, its verification, the choices of the configuration and the check of a message's ``policy``
read this table and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from lsu_mesh.fusion.intersection import Fusion, fuse_all
from lsu_mesh.fusion.relaxed import fuse_relaxed
from lsu_mesh.supports.support import Support

Fuse = Callable[[Sequence[Support], int], Fusion]
"""``(supports, faults) -> Fusion``; the supports come in the order of their sources' names, at least one."""


@dataclass(frozen=True)
class Policy:
    """One way to make one set of many.

    ``function`` is called with at least ``sources_needed(faults)`` supports of one dimension; its set holds the state
    as long as at most ``faults`` of them are wrong. It raises ``InconsistentData`` where no state fits.
    """

    name: str
    function: Fuse
    algorithm: int
    """Raised whenever the bits of the result change; published with each fused set."""
    takes_faults: bool
    """Whether ``faults`` sources may be wrong. Without, every source is trusted and ``faults`` must be 0."""
    sources_needed: Callable[[int], int]
    """How many sources must be there, by ``faults``, so that they hold the state by themselves."""
    is_intersection: bool = False
    """Whether the result is ``∩ supports``. A fusion node then meets its own set with all sources at once, and can find
    the largest family of sources that agree; else it meets it with the result of ``function``."""


POLICIES: Mapping[str, Policy] = {
    policy.name: policy
    for policy in (
        Policy(
            "intersect",
            lambda supports, faults: fuse_all(supports),
            algorithm=2,
            takes_faults=False,
            sources_needed=lambda faults: 1,
            is_intersection=True,
        ),
        Policy(
            "relaxed",
            fuse_relaxed,
            algorithm=2,
            takes_faults=True,
            sources_needed=lambda faults: faults + 1,
        ),
    )
}
"""Name of a policy → the policy."""
