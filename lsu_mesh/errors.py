"""The errors that the library raises; all are :class:`LsuMeshError`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lsu_mesh.filters.run_record import FilterRun


class LsuMeshError(Exception):
    """Base class of every error that ``lsu_mesh`` raises on purpose.

    Attributes
    ----------
    run:
        What :func:`lsu_mesh.run_filter` had of the rows before the one that failed; ``None`` for every other error.
    """

    run: FilterRun | None = None


class ModelError(LsuMeshError, ValueError):
    """A model, a set or an option is malformed; the message names the field, the value and the remedy.

    Attributes
    ----------
    problems:
        Each mistake by itself, where several were found together.
    """

    def __init__(self, *problems: str) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems


class InconsistentData(LsuMeshError):
    """The data contradict the declared bounds: the intersection of the sets is *proved* empty.

    Attributes
    ----------
    rows:
        Indices of the outputs whose strip takes part in the contradiction, empty where no output is to blame.
    gap:
        Smallest distance, in the unit of the first row of ``rows``, by which the strip misses the set
        (0 where only the combination of several strips, or of sets, is contradictory).
    """

    def __init__(self, message: str, rows: Sequence[int] = (), gap: float = 0.0) -> None:
        super().__init__(message)
        self.rows = tuple(rows)
        self.gap = gap


class UnboundedSupport(LsuMeshError):
    """A bounded set was needed and none is known (infinite prior, no domain)."""
