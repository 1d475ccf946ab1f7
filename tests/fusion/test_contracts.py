"""Every fusion policy keeps the contract; policies that forget something fail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from lsu_mesh import InconsistentData, Orthotope, Support
from lsu_mesh.fusion import relaxed
from lsu_mesh.fusion.intersection import Fusion, fuse_all
from lsu_mesh.fusion.policies import POLICIES, Fuse
from lsu_mesh.fusion.relaxed import fuse_relaxed
from lsu_mesh.testing import check_policy
from lsu_mesh.testing.policy_contract import fusion_policies


@pytest.mark.parametrize("name", fusion_policies())
def test_every_policy_keeps_the_contract(name: str) -> None:
    check_policy(name, seeds=20)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("name", fusion_policies())
def test_every_policy_keeps_the_contract_in_many_cases(name: str) -> None:
    check_policy(name, seeds=range(100, 5000))


def break_policy(monkeypatch: pytest.MonkeyPatch, name: str, function: Fuse) -> None:
    """Put another function in place of a policy's own."""
    monkeypatch.setitem(POLICIES, name, replace(POLICIES[name], function=function))


def test_a_forgotten_family_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = relaxed._consistent_families

    def without_the_last(*arguments: object) -> object:
        found = whole(*arguments)  # type: ignore[arg-type]
        return found[:-1] or found

    monkeypatch.setattr(relaxed, "_consistent_families", without_the_last)
    with pytest.raises(AssertionError, match=r"policy 'relaxed', .*families with a common point each: found bounds"):
        check_policy("relaxed", seeds=6)


def test_the_largest_family_alone_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = relaxed._consistent_families
    monkeypatch.setattr(relaxed, "_consistent_families", lambda *a: whole(*a)[:1])
    with pytest.raises(AssertionError, match="bounds that hold"):
        check_policy("relaxed", seeds=6)


def test_wrong_sources_that_are_not_named_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    unnamed = lambda supports, faults: fuse_relaxed(supports, faults)._replace(rejected=())  # noqa: E731
    break_policy(monkeypatch, "relaxed", unnamed)
    with pytest.raises(AssertionError, match=r"wrong sources far away: found \(\) rejected"):
        check_policy("relaxed", seeds=6)


def test_a_forgotten_branch_for_many_sources_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """More families than can be formed: an intersection of all takes their place."""

    def of_all(bounds: Sequence[tuple[np.ndarray, np.ndarray]], faults: int) -> Fusion:
        return fuse_all([Orthotope(lower, upper) for lower, upper in bounds])

    monkeypatch.setattr(relaxed, "_fuse_coordinates", of_all)
    with pytest.raises(AssertionError, match="13 sources, 4 of them wrong"):
        check_policy("relaxed", seeds=6)


def test_a_source_that_is_left_out_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    def all_but_the_first(supports: Sequence[Support], faults: int) -> Fusion:
        return fuse_all(supports[1:] or supports)

    break_policy(monkeypatch, "intersect", all_but_the_first)
    with pytest.raises(AssertionError, match="another order: found"):
        check_policy("intersect")


def test_a_fused_set_that_is_a_little_too_small_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    def shrunk(supports: Sequence[Support], faults: int) -> Fusion:
        fused = fuse_all(supports)
        lower, upper = fused.bounds
        return fused._replace(bounds=(lower + 1e-12 * np.abs(lower), upper))

    break_policy(monkeypatch, "intersect", shrunk)
    with pytest.raises(AssertionError, match=r"policy 'intersect', .* bounds that hold"):
        check_policy("intersect")


def test_a_wrong_source_too_many_that_is_not_told_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    def never_empty(supports: Sequence[Support], faults: int) -> Fusion:
        try:
            return fuse_all(supports)
        except InconsistentData:
            return fuse_all(supports[:1])

    break_policy(monkeypatch, "intersect", never_empty)
    with pytest.raises(AssertionError, match="one wrong source too many"):
        check_policy("intersect")
