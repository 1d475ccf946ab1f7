"""Fusion with sources that lie: the set holds the truth, the liar is named, and let back in."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

MakeMesh = Callable[..., Any]
STEPS = 120

FOUR = """
[mesh]
name = "four"
dt = 0.02
steps = 120
seed = 1

[model]
A = [[1.0, -0.5, 0.2], [0.5, 0.1, 0.0], [0.3, 0.0, -0.1]]
B = [[0.1], [0.6], [0.3]]
rho = [0.1, 0.1, 0.1]
domain = { lower = [-100.0, -100.0, -100.0], upper = [100.0, 100.0, 100.0] }
prior = { lower = [-5.0, -5.0, -5.0], upper = [5.0, 5.0, 5.0] }

[plant]
x1 = [1.0, 0.5, -0.5]

[sensors.a]
C = [[1.0, 0.0, 0.5]]
r = [0.3]
[sensors.b]
C = [[0.0, 1.0, 0.5]]
r = [0.3]
[sensors.c]
C = [[1.0, -1.0, 0.3]]
r = [0.3]
[sensors.d]
C = [[0.5, 0.5, 1.0]]
r = [0.3]

[filters.fa]
kind = "LSUP"
sensors = ["a"]
[filters.fb]
kind = "LSUO"
sensors = ["b"]
[filters.fc]
kind = "LSUCZ"
sensors = ["c"]
[filters.fd]
kind = "LSUPB"
sensors = ["d"]

[fusion.main]
sources = ["fa", "fb", "fc", "fd"]
policy = "relaxed"
faults = 1
quarantine_after = 3
"""


@pytest.fixture
def four(mesh_of: MakeMesh, tmp_path: Path) -> Callable[..., Any]:
    file = tmp_path / "four.toml"
    file.write_text(FOUR)

    def make(*overrides: str) -> Any:
        mesh = mesh_of(*overrides, file=file)
        mesh.run(STEPS * 0.02 + 0.3, tick_ms=10)
        return mesh

    return make


def outside(mesh: Any, name: str) -> list[int]:
    truth = mesh.truth()
    return [
        p.step
        for p in mesh.posteriors(name)
        if not all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))
    ]


def lie(kind: str, size: float, first: int = 30, last: int = 80) -> str:
    return f'sensors.c.faults=[{{kind="{kind}", from={first}, to={last}, size={size}}}]'


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    ("kind", "size"), [("bias", 2.0), ("bias", 0.4), ("drift", 0.05), ("stuck", 1.0), ("random", 3.0)]
)
def test_with_one_fault_allowed_the_fused_set_holds_the_truth(
    four: Callable[..., Any], kind: str, size: float, seed: int
) -> None:
    mesh = four(lie(kind, size), f"mesh.seed={seed}", "filters.fc.reset_after=2")
    fused = mesh.newest("main")
    assert len(fused) == STEPS
    assert outside(mesh, "main") == []


def test_a_liar_would_cut_off_the_truth_if_it_were_trusted(four: Callable[..., Any]) -> None:
    trusting = four(
        lie("bias", 0.4), 'fusion.main.policy="intersect"', "fusion.main.faults=0", 'filters.fc.on_inconsistency="hold"'
    )
    assert outside(trusting, "main"), "otherwise the tests above show nothing"


def test_the_liar_is_named_quarantined_and_let_back_in(four: Callable[..., Any]) -> None:
    mesh = four(lie("drift", 0.2), 'filters.fc.on_inconsistency="widen"')
    named = mesh.events("source-rejected")
    assert named
    assert {e.about["source"] for e in named} == {"fc"}
    (quarantined,) = mesh.events("quarantined")
    assert quarantined.about["source"] == "fc"
    (back,) = mesh.events("let-back-in")
    assert back.step > 80
    fused = mesh.newest("main")
    assert fused[quarantined.step].quarantined == ["fc"]
    assert fused[STEPS].quarantined == []
    assert outside(mesh, "main") == []


def test_a_source_that_abandons_its_epoch_takes_the_trusting_fusion_with_it(mesh_of: MakeMesh) -> None:
    domain = "model.domain={lower=[-100.0, -100.0, -100.0], upper=[100.0, 100.0, 100.0]}"
    fault = 'sensors.s2.faults=[{kind="drift", from=10, to=30, size=0.1}]'
    mesh = mesh_of("mesh.steps=80", domain, fault, "filters.box.reset_after=2", "filters.cz.reset_after=2")
    mesh.run(80 * 0.02 + 0.3)
    resets = mesh.events("reset")
    assert resets
    fused = mesh.newest("main")
    assert fused[80].epoch >= 1
    assert fused[80].status == "ok"
    late = {k for k in outside(mesh, "main") if k > max(e.step for e in resets) + 2}
    assert late == set(), "after the last reset nothing of the lie is left"


def test_more_liars_than_allowed_are_said(four: Callable[..., Any]) -> None:
    faults = [
        f'sensors.{s}.faults=[{{kind="bias", from=30, to=40, size={size}}}]' for s, size in (("a", 9.0), ("b", -9.0))
    ]
    widen = [f'filters.{f}.on_inconsistency="widen"' for f in ("fa", "fb")]
    mesh = four(*faults, *widen)
    assert mesh.events("too-many-faults") or outside(mesh, "main") == []
    assert len(mesh.newest("main")) == STEPS


def test_when_all_sources_fall_silent_the_fusion_goes_on_by_the_clock_and_its_set_grows(
    mesh_of: MakeMesh, tmp_path: Path
) -> None:
    file = tmp_path / "silent.toml"
    file.write_text(
        '[mesh]\nname = "silent"\ndt = 0.1\nsteps = 40\n'
        "[model]\nA = [[1.0]]\nrho = [0.1]\nprior = { lower = [-5.0], upper = [5.0] }\n"
        "[sensors.s]\nC = [[1.0]]\nr = [0.2]\n"
        '[filters.f]\nkind = "LSUO"\nsensors = ["s"]\n[fusion.main]\nsources = ["f"]\n'
    )
    mesh = mesh_of(file=file)
    mesh.run(1.0, tick_ms=20)
    for name in ("plant", "s", "f"):
        mesh.kill(name)
    reached = max(mesh.newest("main"))
    assert reached < 15
    mesh.run(8.0, tick_ms=20)
    fused = mesh.newest("main")
    assert max(fused) == 40, "steps end where the configuration says"
    widths = [fused[k].upper[0] - fused[k].lower[0] for k in range(reached, 41)]
    assert all(later > earlier for earlier, later in pairwise(widths))
    assert fused[40].status == "predicted"


def test_fusions_of_fusions_hold_the_truth_and_no_more_than_the_hub(mesh_of: MakeMesh) -> None:
    tree = (
        'fusion.left={sources=["box", "para"]}',
        'fusion.right={sources=["cz"]}',
        'fusion.top={sources=["left", "right"]}',
    )
    mesh = mesh_of("mesh.steps=60", *tree)
    mesh.run(60 * 0.02 + 0.3)
    top, hub = mesh.newest("top"), mesh.newest("main")
    assert outside(mesh, "top") == []
    assert len(top) == 60
    ratios = [
        (high - low) / (hub_high - hub_low)
        for k in range(5, 61)
        for low, high, hub_low, hub_high in zip(top[k].lower, top[k].upper, hub[k].lower, hub[k].upper, strict=True)
    ]
    assert sum(ratios) / len(ratios) < 1.05
