"""Sets that hold the state, one file per kind; the names below are loaded when they are first used.

The kinds convert into one another, so their files import one another: the one circle among the modules.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from lsu_mesh.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
    from lsu_mesh.supports.exact import Membership
    from lsu_mesh.supports.intersection import Intersection
    from lsu_mesh.supports.orthotope import Orthotope
    from lsu_mesh.supports.parallelotope import Parallelotope
    from lsu_mesh.supports.support import Support
    from lsu_mesh.supports.zonotope import Zonotope
else:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        {
            "lsu_mesh.supports.constrained_zonotope": ("ConstrainedZonotope",),
            "lsu_mesh.supports.exact": ("Membership",),
            "lsu_mesh.supports.intersection": ("Intersection",),
            "lsu_mesh.supports.orthotope": ("Orthotope",),
            "lsu_mesh.supports.parallelotope": ("Parallelotope",),
            "lsu_mesh.supports.support": ("Support",),
            "lsu_mesh.supports.zonotope": ("Zonotope",),
        },
    )

__all__ = [
    "ConstrainedZonotope",
    "Intersection",
    "Membership",
    "Orthotope",
    "Parallelotope",
    "Support",
    "Zonotope",
]
