"""Guaranteed state estimation for linear models with bounded noise.

The names below are loaded when they are first used, so that ``import lsu_mesh`` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from lsu_mesh.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from lsu_mesh import metrics, systems, testing
    from lsu_mesh.errors import InconsistentData, LsuMeshError, ModelError, UnboundedSupport
    from lsu_mesh.filters import (
        LSUCZ,
        LSUO,
        LSUP,
        LSUPB,
        Filter,
        FilterBank,
        FilterRun,
        Kalman,
        NonlinearFilter,
        OutputPrediction,
        TruncatedKalman,
        WindowMAP,
        ZonotopicKalman,
        run_filter,
    )
    from lsu_mesh.fusion import Fusion, fuse
    from lsu_mesh.model import ContinuousModel, LSUModel
    from lsu_mesh.nonlinear.model import NonlinearModel
    from lsu_mesh.simulation import Simulation, simulate
    from lsu_mesh.supports import ConstrainedZonotope, Intersection, Orthotope, Parallelotope, Support, Zonotope
else:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        {
            "lsu_mesh.errors": ("InconsistentData", "LsuMeshError", "ModelError", "UnboundedSupport"),
            "lsu_mesh.filters": (
                "LSUCZ", "LSUO", "LSUP", "LSUPB", "Filter", "FilterBank", "FilterRun", "Kalman", "NonlinearFilter",
                "OutputPrediction", "TruncatedKalman", "WindowMAP", "ZonotopicKalman", "run_filter",
            ),
            "lsu_mesh.fusion": ("Fusion", "fuse"),
            "lsu_mesh.metrics": (),
            "lsu_mesh.model": ("ContinuousModel", "LSUModel"),
            "lsu_mesh.nonlinear.model": ("NonlinearModel",),
            "lsu_mesh.simulation": ("Simulation", "simulate"),
            "lsu_mesh.supports": (
                "ConstrainedZonotope", "Intersection", "Orthotope", "Parallelotope", "Support", "Zonotope",
            ),
            "lsu_mesh.systems": (),
            "lsu_mesh.testing": (),
        },
    )  # fmt: skip

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
    "NonlinearFilter",
    "NonlinearModel",
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
    "metrics",
    "run_filter",
    "simulate",
    "systems",
    "testing",
]
__version__ = "0.1.0"
