"""Bayesian transfer between filter nodes: narrower, never wrong, over any topology."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUModel, Orthotope, Parallelotope
from lsu_mesh.filters.filter import GainOf
from lsu_mesh.filters.held_inputs import HeldInputs
from lsu_mesh.mesh.estimation.filter_step import Transfers, filter_step
from lsu_mesh.mesh.estimation.step_data import StepData
from lsu_mesh.mesh.messages import Posterior, Prediction
from lsu_mesh.mesh.verification import verify

MakeMesh = Callable[..., Any]
STEPS = 60


def transfers(way: str, *names: str) -> list[str]:
    return [f'filters.{name}.transfer="{way}"' for name in names]


def finished(mesh: Any) -> Any:
    mesh.run(STEPS * 0.02 + 0.3)
    return mesh


def holds_truth(mesh: Any, name: str) -> bool:
    truth = mesh.truth()
    return all(
        all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))
        for p in mesh.posteriors(name)
    )


def mean_width(mesh: Any, name: str) -> float:
    return float(np.mean([np.subtract(p.upper, p.lower) for p in mesh.newest(name).values()]))


@pytest.mark.parametrize("way", ["predictor", "fused"])
def test_transfer_narrows_every_filter_and_keeps_the_truth(mesh_of: MakeMesh, way: str) -> None:
    alone = finished(mesh_of(f"mesh.steps={STEPS}"))
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", *transfers(way, "box", "para", "cz")))
    for name in ("box", "para", "cz"):
        assert holds_truth(mesh, name)
        assert mean_width(mesh, name) < 0.97 * mean_width(alone, name), name
        late = [p for k, p in mesh.newest(name).items() if k > 2]
        assert {p.gain_of for p in late} == {"hull"}
        assert sum(p.gain is not None for p in late) > 0.9 * len(late), "nil where the hulls do not show what was cut"
        assert all(p.gain >= 0 for p in late if p.gain is not None)
        assert any(p.gain > 0.1 for p in late if p.gain is not None)
        topic = "prediction" if way == "predictor" else "fused"
        assert all(any(reference[0] == topic for reference in p.used) for p in late)
    assert holds_truth(mesh, "main")


def test_transfers_come_before_the_data_in_the_provenance(mesh_of: MakeMesh) -> None:
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", *transfers("predictor", "box")))
    topics = [reference[0] for reference in mesh.newest("box")[30].used]
    assert topics == ["input", "prediction", "prediction", "measurement", "measurement"]


def test_without_transfer_there_is_no_gain(mesh_of: MakeMesh) -> None:
    mesh = finished(mesh_of(f"mesh.steps={STEPS}"))
    assert {(p.gain, p.gain_of) for p in mesh.posteriors("box")} == {(None, None)}


def test_a_node_measures_by_supports_where_it_is_told_to(mesh_of: MakeMesh) -> None:
    names = ("box", "para", "cz")
    changes = [f'filters.{name}.transfer.gain="support"' for name in names]
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", *transfers("predictor", *names), *changes))
    for name in names:
        late = [p for k, p in mesh.newest(name).items() if k > 2]
        assert {p.gain_of for p in late} == {"support"}
        assert all(p.gain >= 0 for p in late)
    found = verify(mesh.configuration, [message for _, message in mesh.sent])
    assert found.holds
    assert not found.unverifiable
    lie = [
        msgspec.structs.replace(m, gain_of="hull") if isinstance(m, Posterior) and m.gain_of else m
        for _, m in mesh.sent
    ]
    assert {one.field for one in verify(mesh.configuration, lie).differences} == {"gain_of"}


def test_a_cut_that_no_hull_shows_is_not_published_as_nothing() -> None:
    """A constrained zonotope cut by a diagonal band that touches all sides of its hull."""
    engine = LSUCZ(LSUModel(np.eye(2), None, [[1.0, 1.0]], 0.1, 0.1), Orthotope([-1.0, -1.0], [1.0, 1.0]))
    band, start = Parallelotope([0.0, 0.0], [[1.0, 0.1], [-1.0, 0.1]]), engine.snapshot()
    nothing, some = np.array([np.nan]), cast("Prediction", None)
    no_data = StepData(1, 0, 0, data=(), y=nothing, r=nothing, u=None, inputs=HeldInputs([], []))
    choices: list[tuple[GainOf, Any]] = [("hull", None), ("support", pytest.approx(1.6607, abs=1e-4))]
    for gain, expected in choices:
        engine.restore(start)
        outcome = filter_step(engine, no_data, Transfers([some], lambda _: band, gain), "drop")
        assert (outcome.gain, outcome.gain_of) == (expected, gain)


def test_predictors_are_taken_only_from_those_named(mesh_of: MakeMesh) -> None:
    changes = [*transfers("predictor", "box"), 'filters.box.transfer_from=["cz"]']
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", *changes))
    sources = {r[1] for p in mesh.posteriors("box") for r in p.used if r[0] == "prediction"}
    assert sources == {"filter/cz"}


def test_a_transfer_that_leaves_a_point_has_no_finite_gain_and_kills_nobody(mesh_of: MakeMesh) -> None:
    from lsu_mesh.mesh.keys import key
    from lsu_mesh.mesh.messages import OrthotopeMessage, encode

    mesh = mesh_of(f"mesh.steps={STEPS}", *transfers("predictor", "box"))
    mesh.kill("cz")
    mesh.run(0.37)
    own = next(m for m in mesh.of(Prediction, "box") if m.step == 20)
    middle = (0.5 * (np.array(own.lower) + own.upper)).tolist()
    point = Prediction(
        v=1, src="filter/cz", boot="f" * 16, seq=0, step=20, sent_ns=1, origin_ns=1, model=mesh.configuration.digest(),
        support=OrthotopeMessage(lower=middle, upper=middle), lower=middle, upper=middle,
        y_lower=[0.0], y_upper=[1.0], y_point=[0.5], epoch=0, guarantee="declared",
    )  # fmt: skip
    mesh.hand_over(key("demo", "prediction", "cz"), encode(point))
    mesh.run(STEPS * 0.02)
    assert ("prediction", "filter/cz", "f" * 16, 0) in mesh.newest("box")[20].used
    assert mesh.newest("box")[20].gain is None
    assert max(mesh.newest("box")) == STEPS


def test_the_data_predictor_is_marked_as_not_guaranteed(mesh_of: MakeMesh) -> None:
    sharp = ("sensors.s4={C=[[1.0, 0.0, 0.5]], r=[0.05]}", 'filters.sharp={kind="LSUCZ", sensors=["s2", "s3", "s4"]}')
    changes = [*sharp, *transfers("data-predictor", "box"), "sensors.s1.r=[1.0]", 'filters.box.transfer_from=["sharp"]']
    mesh = finished(mesh_of(f"mesh.steps={STEPS}", *changes))
    posteriors = mesh.posteriors("box")
    used = [p for p in posteriors if any(r[0] == "prediction" for r in p.used)]
    assert used, "some output predictor was narrow enough"
    first = used[0].step
    assert all(p.guarantee == ("none" if p.step >= first else "declared") for p in posteriors)
    assert any(p.guarantee == "none" for p in mesh.posteriors("main")), "the mark travels with the sets"


def test_a_contradicting_transfer_is_left_out_for_its_step(mesh_of: MakeMesh) -> None:
    from lsu_mesh.mesh.keys import key
    from lsu_mesh.mesh.messages import OrthotopeMessage, encode

    mesh = mesh_of(f"mesh.steps={STEPS}", *transfers("predictor", "box"))
    mesh.kill("cz")
    mesh.run(0.4)
    lie = Prediction(
        v=1, src="filter/cz", boot="f" * 16, seq=0, step=22, sent_ns=1, origin_ns=1, model=mesh.configuration.digest(),
        support=OrthotopeMessage(lower=[90.0] * 3, upper=[91.0] * 3), lower=[90.0] * 3, upper=[91.0] * 3,
        y_lower=[0.0], y_upper=[1.0], y_point=[0.5], epoch=0, guarantee="declared",
    )  # fmt: skip
    mesh.hand_over(key("demo", "prediction", "cz"), encode(lie))
    mesh.run(STEPS * 0.02)
    (event,) = mesh.events("transfer-rejected")
    assert event.about == {"source": "filter/cz", "step": 22}
    assert mesh.newest("box")[22].status == "ok"
    assert holds_truth(mesh, "box")


def ring(count: int, steps: int) -> str:
    """A static state, seen by each node of a ring through a sensor of its own, without any fusion."""
    lines = [
        f'[mesh]\nname = "ring"\ndt = 0.02\nsteps = {steps}',
        "[model]\nA = [[1.0, 0.0], [0.0, 1.0]]\nrho = [0.0, 0.0]",
        "[model.prior]\nlower = [-10.0, -10.0]\nupper = [10.0, 10.0]",
        "[plant]\nx1 = [1.0, -2.0]",
    ]
    for i in range(count):
        angle = np.pi * i / count
        lines.append(f"[sensors.s{i}]\nC = [[{np.cos(angle)}, {np.sin(angle)}]]\nr = [0.5]")
        left, right = (i - 1) % count, (i + 1) % count
        lines.append(
            f'[filters.f{i}]\nkind = "LSUO"\nsensors = ["s{i}"]\ntransfer = "predictor"\n'
            f'transfer_from = ["f{left}", "f{right}"]'
        )
    return "\n\n".join(lines)


def test_a_ring_of_eight_reaches_the_hull_of_a_hub_after_a_diameter_of_steps(mesh_of: MakeMesh, tmp_path: Path) -> None:
    count, steps = 8, 30
    file = tmp_path / "ring.toml"
    file.write_text(ring(count, steps))
    mesh = mesh_of(file=file)
    mesh.run(steps * 0.02 + 0.3)
    names = [f"f{i}" for i in range(count)]
    for name in names:
        assert holds_truth(mesh, name)
    newest = {name: mesh.newest(name) for name in names}
    for k in range(10, steps + 1 - count // 2):
        hub_lower = np.max([newest[name][k].lower for name in names], axis=0)
        hub_upper = np.min([newest[name][k].upper for name in names], axis=0)
        for name in names:
            later = newest[name][k + count // 2]
            widths, hub = np.subtract(later.upper, later.lower), hub_upper - hub_lower
            assert np.all(widths <= 1.01 * hub), (name, k)
