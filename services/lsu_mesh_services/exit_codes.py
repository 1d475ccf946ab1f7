"""The exit codes of ``lsu-mesh``."""

from __future__ import annotations

OK, FAILURE, USAGE, COULD_NOT_START, NOT_MET = 0, 1, 2, 3, 4
