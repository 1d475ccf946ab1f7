"""Sets of another arithmetic are unverifiable by name, and all that does not depend on it is still checked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.estimation.fusion_step import fusion_algorithm
from lsu_mesh.mesh.messages import Message, Posterior, decode, encode
from lsu_mesh.mesh.verification import verify

MakeMesh = Callable[..., Any]


@pytest.fixture(scope="module")
def messages(module_mesh: MakeMesh) -> tuple[Any, list[Message]]:
    mesh = module_mesh("mesh.steps=30")
    mesh.run(1.2)
    return mesh, [decode(message.topic, encode(message)) for _, message in mesh.sent]


def raise_number(monkeypatch: pytest.MonkeyPatch) -> str:
    """Today's LSUCZ has another number than the recorded one."""
    old = LSUCZ.algorithm
    monkeypatch.setattr(LSUCZ, "algorithm", old + 1)
    return f"algorithm {old}, this is {old + 1}"


def test_sets_of_another_number_that_differ_are_unverifiable_and_equal_ones_are_exact(
    messages: tuple[Any, list[Message]], monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, recorded = messages
    numbers = raise_number(monkeypatch)
    equal = verify(mesh.configuration, recorded)
    assert equal.holds
    assert not equal.unverifiable, "equal bits are a proof, whatever the number"
    altered = [
        structs.replace(m, lower=np.nextafter(m.lower, -np.inf).tolist())
        if isinstance(m, Posterior) and m.name in ("cz", "main") and m.step > 20
        else m
        for m in recorded
    ]
    found = verify(mesh.configuration, altered)
    assert found.outdated[f"LSUCZ {numbers}"] >= 10
    number = fusion_algorithm(POLICIES["intersect"])
    assert found.outdated[f"intersect algorithm {number - 1}, this is {number}"] == 10
    assert len(found.unverifiable) == found.outdated.total()
    assert found.exact["filter/box", "posterior"] == 30
    assert found.exact["filter/cz", "posterior"] == 20
    assert found.holds
    assert found.containment.holding == 207, "the truth is looked for in all of them"
    monkeypatch.undo()
    assert len(verify(mesh.configuration, altered).differences) == found.outdated.total()


def test_claims_of_sets_of_an_older_number_are_proved(
    messages: tuple[Any, list[Message]], monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, recorded = messages
    raise_number(monkeypatch)
    at = next(i for i, m in enumerate(recorded) if isinstance(m, Posterior) and (m.name, m.step) == ("cz", 12))
    for claim, value in (("guarantee", "none"), ("epoch", 4), ("missing", ["s2"]), ("status", "predicted")):
        altered = list(recorded)
        altered[at] = structs.replace(altered[at], **{claim: value})
        found = verify(mesh.configuration, altered)
        assert ("filter/cz", 12, claim) in {(one.peer, one.step, one.field) for one in found.false_claims}


def test_no_number_is_the_first(module_mesh: MakeMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LSUO, "algorithm", 1)
    mesh = module_mesh("mesh.steps=10")
    mesh.run(0.4)
    recorded = [decode(message.topic, encode(message)) for _, message in mesh.sent]
    names = {m.name for m in recorded if isinstance(m, Posterior) and m.algorithm == 1}
    assert names
    first = [structs.replace(m, algorithm=None) if getattr(m, "algorithm", 0) == 1 else m for m in recorded]
    assert {m.algorithm for m in first if isinstance(m, Posterior) and m.name in names} == {None}
    found = verify(mesh.configuration, first)
    assert found.holds
    assert not found.unverifiable
