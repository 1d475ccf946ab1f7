"""Fusion of sets of one step.

Loaded at once: ``fuse`` is also the name of its module, which would hide the function if it were imported later.
"""

from lsu_mesh.fusion.fuse import fuse
from lsu_mesh.fusion.intersection import Fusion

__all__ = ["Fusion", "fuse"]
