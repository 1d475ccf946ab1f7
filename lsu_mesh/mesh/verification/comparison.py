"""Recorded sets compared with what their provenance gives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import msgspec

from lsu_mesh.errors import LsuMeshError
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Fused, Message, Posterior, Prediction, Smoothed
from lsu_mesh.mesh.verification.archive import Archive, DoesNotFit, Unverifiable
from lsu_mesh.mesh.verification.recompute import FilterRecomputation, FusionRecomputation, Recomputation
from lsu_mesh.mesh.verification.recomputed import Recomputed

Recorded = Posterior | Prediction | Smoothed


class Outcome(NamedTuple):
    """What came of one set."""

    recomputed: Recomputed | None = None
    """What its claims rest on, without the fields; ``None`` where it cannot be recomputed."""
    different: tuple[str, Any, Any] | None = None
    """The first place that differs, what is recorded there, and what was expected."""
    missing: str = ""
    """Why it cannot be verified."""
    is_outdated: bool = False
    """Whether that is because another arithmetic computed it."""


class Comparison:
    """Compares the sets of any peers, each peer's in their order."""

    def __init__(self, configuration: Configuration, archive: Archive) -> None:
        self._configuration = configuration
        self._archive = archive
        self._recomputations: dict[str, Recomputation] = {}

    def compare(self, recorded: Recorded) -> Outcome:
        """Equal is a proof, whatever number the arithmetic had. What differs by another arithmetic is unverifiable."""
        recomputation = self._recomputation(recorded)
        recomputed: Recomputed | None
        different: tuple[str, Any, Any] | None
        try:
            if isinstance(recorded, Prediction):
                recomputed = recomputation.prediction(recorded)
            elif isinstance(recorded, Smoothed):
                recomputed = recomputation.smoothed(recorded)
            else:
                recomputed = recomputation.posterior(recorded)
            different = next(differences(recorded, recomputed.fields), None)
        except Unverifiable as reason:
            return Outcome(missing=str(reason))
        except DoesNotFit as wrong:
            recomputed, different = None, (wrong.field, wrong.recorded, wrong.expected)
        except LsuMeshError as error:
            recomputed, different = None, ("base", "a set of the model", str(error))
        other = None if different is None else recomputation.other_algorithm(recorded)
        if other is not None:
            return Outcome(missing=other, is_outdated=True)
        return Outcome(None if recomputed is None else replace(recomputed, fields={}), different)

    def _recomputation(self, recorded: Recorded) -> Recomputation:
        known = self._recomputations.get(recorded.src)
        if known is None:
            kind = FusionRecomputation if isinstance(recorded, Fused) else FilterRecomputation
            known = self._recomputations[recorded.src] = kind(self._configuration, self._archive, recorded.name)
        return known


def differences(recorded: Message, fields: Any) -> Iterator[tuple[str, Any, Any]]:
    """``(place, recorded, recomputed)`` of every number of ``fields`` that differs, even in the sign of a zero."""
    for name, value in sorted(fields.items(), key=lambda item: item[0] == "support"):
        yield from _compare(name, msgspec.to_builtins(getattr(recorded, name)), msgspec.to_builtins(value))


def _compare(place: str, old: Any, new: Any) -> Iterator[tuple[str, Any, Any]]:
    if msgspec.msgpack.encode(old) == msgspec.msgpack.encode(new):
        return
    if isinstance(old, dict) and isinstance(new, dict) and old.keys() == new.keys():
        for key in old:
            yield from _compare(f"{place}.{key}", old[key], new[key])
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for i, pair in enumerate(zip(old, new, strict=True)):
            yield from _compare(f"{place}[{i}]", *pair)
    else:
        yield place, old, new
