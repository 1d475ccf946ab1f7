"""Sets of another arithmetic are unverifiable by name, and all that does not depend on it is still checked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from msgspec import structs

from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.mesh.messages import Message, Posterior, decode, encode
from lsu_mesh.mesh.verification import verify

MakeMesh = Callable[..., Any]


@pytest.fixture(scope="module")
def messages(module_mesh: MakeMesh) -> tuple[Any, list[Message]]:
    mesh = module_mesh("mesh.steps=30")
    mesh.run(1.2)
    return mesh, [decode(message.topic, encode(message)) for _, message in mesh.sent]


def test_sets_of_an_older_number_are_unverifiable_and_the_rest_is_exact(
    messages: tuple[Any, list[Message]], monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, recorded = messages
    monkeypatch.setattr(LSUCZ, "algorithm", 2)
    found = verify(mesh.configuration, recorded)
    assert found.outdated == {"LSUCZ algorithm 1, this is 2": 60, "intersect algorithm 1, this is 2": 30}
    assert len(found.unverifiable) == 90
    assert found.exact["filter/box", "posterior"] == 30
    assert found.holds
    assert found.containment.holding == 207, "the truth is looked for in all of them"


def test_claims_of_sets_of_an_older_number_are_proved(
    messages: tuple[Any, list[Message]], monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, recorded = messages
    monkeypatch.setattr(LSUCZ, "algorithm", 2)
    at = next(i for i, m in enumerate(recorded) if isinstance(m, Posterior) and (m.name, m.step) == ("cz", 12))
    for claim, value in (("guarantee", "none"), ("epoch", 4), ("missing", ["s2"]), ("status", "predicted")):
        altered = list(recorded)
        altered[at] = structs.replace(altered[at], **{claim: value})
        found = verify(mesh.configuration, altered)
        assert ("filter/cz", 12, claim) in {(one.peer, one.step, one.field) for one in found.false_claims}


def test_no_number_is_the_first(messages: tuple[Any, list[Message]]) -> None:
    mesh, recorded = messages
    names = {m.name for m in recorded if isinstance(m, Posterior) and m.algorithm == 1}
    assert names
    first = [structs.replace(m, algorithm=None) if getattr(m, "algorithm", 0) == 1 else m for m in recorded]
    assert {m.algorithm for m in first if isinstance(m, Posterior) and m.name in names} == {None}
    found = verify(mesh.configuration, first)
    assert found.holds
    assert not found.unverifiable
