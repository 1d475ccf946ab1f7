"""The kinds of filters by name, loaded when first used."""

from __future__ import annotations

import difflib
import importlib
from typing import cast

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.filter import Filter

FILTERS: dict[str, str] = {
    "Kalman": "lsu_mesh.filters.kalman",
    "LSUCZ": "lsu_mesh.filters.lsucz",
    "LSUO": "lsu_mesh.filters.lsuo",
    "LSUP": "lsu_mesh.filters.lsup",
    "LSUPB": "lsu_mesh.filters.lsupb",
    "TruncatedKalman": "lsu_mesh.filters.truncated_kalman",
    "WindowMAP": "lsu_mesh.filters.window.window_map",
    "ZonotopicKalman": "lsu_mesh.filters.zonotopic_kalman",
}
"""Kind of a filter (the name of its class) → module that holds it."""


def filter_class(kind: str) -> type[Filter]:
    """The class of this kind.

    Raises ``ModelError`` that names the nearest valid kind.
    """
    if kind not in FILTERS:
        folded = {name.lower().replace("-", ""): name for name in FILTERS}
        near = difflib.get_close_matches(kind.lower().replace("-", ""), folded, n=1, cutoff=0.5)
        hint = f"; did you mean {folded[near[0]]!r}?" if near else ""
        raise ModelError(f"there is no filter {kind!r}{hint} (valid: {', '.join(sorted(FILTERS))})")
    return cast("type[Filter]", getattr(importlib.import_module(FILTERS[kind]), kind))
