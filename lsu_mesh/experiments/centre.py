"""The point that the papers' tables are of: the centre of the set's interval hull."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

CENTRE: Mapping[str, Any] = {"point": "centre"}
"""Options of every guaranteed filter of the experiments, which choose that point."""
