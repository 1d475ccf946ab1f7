"""Guaranteed state estimation for linear models with bounded noise.

The names below are loaded when they are first used, so that ``import lsu_mesh`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lsu_mesh.errors import InconsistentData, LsuMeshError, ModelError, UnboundedSupport
    from lsu_mesh.filters.bank import FilterBank
    from lsu_mesh.filters.filter import Filter, OutputPrediction
    from lsu_mesh.filters.kalman import Kalman
    from lsu_mesh.filters.lsucz import LSUCZ
    from lsu_mesh.filters.lsuo import LSUO
    from lsu_mesh.filters.lsup import LSUP
    from lsu_mesh.filters.lsupb import LSUPB
    from lsu_mesh.filters.run import run_filter
    from lsu_mesh.filters.run_record import FilterRun
    from lsu_mesh.filters.truncated_kalman import TruncatedKalman
    from lsu_mesh.filters.window.window_map import WindowMAP
    from lsu_mesh.filters.zonotopic_kalman import ZonotopicKalman
    from lsu_mesh.fusion.fuse import fuse
    from lsu_mesh.fusion.intersection import Fusion
    from lsu_mesh.model import ContinuousModel, LSUModel
    from lsu_mesh.simulation import Simulation, simulate
    from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
    from lsu_mesh.supports.intersection import Intersection
    from lsu_mesh.supports.orthotope import Orthotope
    from lsu_mesh.supports.parallelotope import Parallelotope
    from lsu_mesh.supports.support import Support
    from lsu_mesh.supports.zonotope import Zonotope

_HOMES = {
    "ConstrainedZonotope": "lsu_mesh.supports.constrained_zonotope",
    "ContinuousModel": "lsu_mesh.model",
    "Filter": "lsu_mesh.filters.filter",
    "FilterBank": "lsu_mesh.filters.bank",
    "FilterRun": "lsu_mesh.filters.run_record",
    "Fusion": "lsu_mesh.fusion.intersection",
    "InconsistentData": "lsu_mesh.errors",
    "Intersection": "lsu_mesh.supports.intersection",
    "Kalman": "lsu_mesh.filters.kalman",
    "LSUCZ": "lsu_mesh.filters.lsucz",
    "LSUModel": "lsu_mesh.model",
    "LSUO": "lsu_mesh.filters.lsuo",
    "LSUP": "lsu_mesh.filters.lsup",
    "LSUPB": "lsu_mesh.filters.lsupb",
    "LsuMeshError": "lsu_mesh.errors",
    "ModelError": "lsu_mesh.errors",
    "Orthotope": "lsu_mesh.supports.orthotope",
    "OutputPrediction": "lsu_mesh.filters.filter",
    "Parallelotope": "lsu_mesh.supports.parallelotope",
    "Simulation": "lsu_mesh.simulation",
    "Support": "lsu_mesh.supports.support",
    "TruncatedKalman": "lsu_mesh.filters.truncated_kalman",
    "UnboundedSupport": "lsu_mesh.errors",
    "WindowMAP": "lsu_mesh.filters.window.window_map",
    "Zonotope": "lsu_mesh.supports.zonotope",
    "ZonotopicKalman": "lsu_mesh.filters.zonotopic_kalman",
    "fuse": "lsu_mesh.fusion.fuse",
    "run_filter": "lsu_mesh.filters.run",
    "simulate": "lsu_mesh.simulation",
}

__all__ = [
    "LSUCZ",
    "LSUO",
    "LSUP",
    "LSUPB",
    "ConstrainedZonotope",
    "ContinuousModel",
    "Filter",
    "FilterBank",
    "FilterRun",
    "Fusion",
    "InconsistentData",
    "Intersection",
    "Kalman",
    "LSUModel",
    "LsuMeshError",
    "ModelError",
    "Orthotope",
    "OutputPrediction",
    "Parallelotope",
    "Simulation",
    "Support",
    "TruncatedKalman",
    "UnboundedSupport",
    "WindowMAP",
    "Zonotope",
    "ZonotopicKalman",
    "fuse",
    "run_filter",
    "simulate",
]
__version__ = "0.1.0"


def __getattr__(name: str) -> object:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'lsu_mesh' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
