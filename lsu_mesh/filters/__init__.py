"""Filters, one file per kind, and what runs them; the names below are loaded when they are first used."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lsu_mesh.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from lsu_mesh.filters.bank import FilterBank
    from lsu_mesh.filters.filter import Filter, OutputPrediction
    from lsu_mesh.filters.kalman import Kalman
    from lsu_mesh.filters.lsucz import LSUCZ
    from lsu_mesh.filters.lsuo import LSUO
    from lsu_mesh.filters.lsup import LSUP
    from lsu_mesh.filters.lsupb import LSUPB
    from lsu_mesh.filters.nonlinear import NonlinearFilter
    from lsu_mesh.filters.run import run_filter
    from lsu_mesh.filters.run_record import FilterRun
    from lsu_mesh.filters.truncated_kalman import TruncatedKalman
    from lsu_mesh.filters.window.window_map import WindowMAP
    from lsu_mesh.filters.zonotopic_kalman import ZonotopicKalman
else:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        {
            "lsu_mesh.filters.bank": ("FilterBank",),
            "lsu_mesh.filters.filter": ("Filter", "OutputPrediction"),
            "lsu_mesh.filters.kalman": ("Kalman",),
            "lsu_mesh.filters.lsucz": ("LSUCZ",),
            "lsu_mesh.filters.lsuo": ("LSUO",),
            "lsu_mesh.filters.lsup": ("LSUP",),
            "lsu_mesh.filters.lsupb": ("LSUPB",),
            "lsu_mesh.filters.nonlinear": ("NonlinearFilter",),
            "lsu_mesh.filters.run": ("run_filter",),
            "lsu_mesh.filters.run_record": ("FilterRun",),
            "lsu_mesh.filters.truncated_kalman": ("TruncatedKalman",),
            "lsu_mesh.filters.window.window_map": ("WindowMAP",),
            "lsu_mesh.filters.zonotopic_kalman": ("ZonotopicKalman",),
        },
    )

__all__ = [
    "LSUCZ",
    "LSUO",
    "LSUP",
    "LSUPB",
    "Filter",
    "FilterBank",
    "FilterRun",
    "Kalman",
    "NonlinearFilter",
    "OutputPrediction",
    "TruncatedKalman",
    "WindowMAP",
    "ZonotopicKalman",
    "run_filter",
]
