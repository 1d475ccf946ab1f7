"""Peers verified side by side: the same verification as one after another, and no silence where a process fails."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from lsu_mesh.mesh.messages import Message, Posterior, decode, encode
from lsu_mesh.mesh.verification import Verification, verify
from lsu_mesh.mesh.verification.comparison import Comparison

MakeMesh = Callable[..., Any]


@pytest.fixture(scope="module")
def messages(module_mesh: MakeMesh) -> tuple[Any, list[Message]]:
    """A mesh with a smoothing filter, which is recomputed along its chain, and transfers."""
    mesh = module_mesh("mesh.steps=40", "filters.cz.lag=2", "filters.para.transfer=predictor")
    mesh.run(1.4)
    return mesh, [decode(message.topic, encode(message)) for _, message in mesh.sent]


def told(found: Verification) -> dict[str, Any]:
    """Everything that a verification says, in its order."""
    containment = found.containment
    said = {name: value for name, value in asdict(found).items() if name != "containment"}
    return said | {"holding": containment.holding, "misses": containment.misses, "excused": containment.excused}


def test_the_same_verification_whatever_the_number_of_processes(messages: tuple[Any, list[Message]]) -> None:
    """With altered, missing and contradictory sets among them."""
    mesh, recorded = messages
    altered = [
        structs.replace(m, lower=np.nextafter(m.lower, -np.inf).tolist())
        if isinstance(m, Posterior) and m.name in ("cz", "main") and m.step in (20, 31)
        else m
        for m in recorded
        if not (m.topic == "measurement" and m.step == 25)
    ]
    for log in (recorded, altered):
        alone, together = (verify(mesh.configuration, log, processes) for processes in (1, 2))
        assert told(alone) == told(together)
    assert alone.differences
    assert alone.unverifiable


@pytest.mark.parametrize("ending", ["fails", "dies"])
def test_a_process_that_fails_is_told(
    messages: tuple[Any, list[Message]], monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    mesh, recorded = messages
    compare, parent = Comparison.compare, os.getpid()

    def breaks(self: Comparison, one: Any) -> Any:
        if one.step == 30 and one.src == "filter/box" and os.getpid() != parent:
            if ending == "dies":
                os._exit(1)
            raise ZeroDivisionError("planted")
        return compare(self, one)

    monkeypatch.setattr(Comparison, "compare", breaks)
    with pytest.raises(RuntimeError, match="planted" if ending == "fails" else "ended before its work"):
        verify(mesh.configuration, recorded, 2)
