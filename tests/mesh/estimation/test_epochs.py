"""Epochs, restarts, lost inputs: nothing of an abandoned epoch is used again, nobody waits or restarts for ever."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lsu_mesh.mesh.estimation.epochs import Epochs
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import Input, OrthotopeMessage, Prediction, encode
from lsu_mesh.mesh.nodes import plant
from lsu_mesh.mesh.verification import verify

MakeMesh = Callable[..., Any]
FILTERS = ("fa", "fb", "fc", "fd")
ROWS = {"a": [1.0, 0.0, 0.5], "b": [0.0, 1.0, 0.5], "c": [1.0, -1.0, 0.3], "d": [0.5, 0.5, 1.0]}
KINDS = {"fa": "LSUP", "fb": "LSUO", "fc": "LSUCZ", "fd": "LSUPB"}
TRUSTING = ('fusion.main.policy="intersect"', "fusion.main.faults=0")


@pytest.fixture
def four(mesh_of: MakeMesh, tmp_path: Path) -> Callable[..., Any]:
    """Four filters with a sensor each and a fusion; without a domain unless a test gives one."""
    lines = [
        '[mesh]\nname = "four"\ndt = 0.02\nsteps = 120\nseed = 1',
        "[model]\nA = [[1.0, -0.5, 0.2], [0.5, 0.1, 0.0], [0.3, 0.0, -0.1]]\nB = [[0.1], [0.6], [0.3]]",
        "rho = [0.1, 0.1, 0.1]\nprior = { lower = [-5.0, -5.0, -5.0], upper = [5.0, 5.0, 5.0] }",
        "[plant]\nx1 = [1.0, 0.5, -0.5]",
        *(f"[sensors.{name}]\nC = [{row}]\nr = [0.3]" for name, row in ROWS.items()),
        *(f'[filters.{name}]\nkind = "{kind}"\nsensors = ["{name[1]}"]' for name, kind in KINDS.items()),
        '[fusion.main]\nsources = ["fa", "fb", "fc", "fd"]\npolicy = "relaxed"\nfaults = 1',
    ]
    file = tmp_path / "four.toml"
    file.write_text("\n".join(lines))
    return lambda *overrides, **options: mesh_of(*overrides, file=file, **options)


DOMAIN = "model.domain={lower=[-100.0, -100.0, -100.0], upper=[100.0, 100.0, 100.0]}"


def lie(sensor: str, kind: str, size: float, first: int, last: int) -> str:
    return f'sensors.{sensor}.faults=[{{kind="{kind}", from={first}, to={last}, size={size}}}]'


def each(setting: str, names: Sequence[str] = FILTERS) -> list[str]:
    return [f"filters.{name}.{setting}" for name in names]


def outside(mesh: Any, name: str, after: int = 0) -> list[int]:
    """Steps of sets that claim to hold the truth and do not."""
    truth = mesh.truth()
    return [
        p.step
        for p in mesh.posteriors(name)
        if p.step > after
        and p.status in ("ok", "predicted", "restarted")
        and not all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))
    ]


def tail(mesh: Any, name: str, count: int = 10) -> set[str]:
    """What the last steps were."""
    newest = mesh.newest(name)
    return {newest[k].status for k in sorted(newest)[-count:]}


# -- transfers in a circle


@pytest.mark.parametrize("start", [(), (DOMAIN,)], ids=["prior", "domain"])
@pytest.mark.parametrize("way", ["predictor", "fused"])
@pytest.mark.parametrize(
    ("kind", "size", "patience"),
    [
        ("drift", 0.1, 2),
        pytest.param("bias", 2.0, 5, marks=pytest.mark.soak),
        pytest.param("random", 3.0, 2, marks=pytest.mark.soak),
    ],
)
def test_filters_that_listen_to_each_other_get_rid_of_a_lie_once_it_has_ended(
    four: Callable[..., Any], way: str, kind: str, size: float, patience: int, start: tuple[str, ...]
) -> None:
    changes = [*each(f'transfer="{way}"'), *each(f"reset_after={patience}"), *TRUSTING, *start]
    mesh = four(lie("c", kind, size, 20, 50), *changes)
    mesh.run(120 * 0.02 + 0.4)
    for name in mesh.estimators():
        assert tail(mesh, name) == {"ok"}, name
        assert outside(mesh, name, after=50 + 20) == [], name
        epochs = [p.epoch for p in mesh.posteriors(name)]
        assert max(epochs) < 15, "an epoch is abandoned once, not at every step"
    found = verify(mesh.configuration, [message for _, message in mesh.sent])
    assert [str(difference) for difference in found.differences] == []
    assert found.unverifiable == []


def test_a_set_that_descends_from_an_abandoned_epoch_is_not_used(four: Callable[..., Any]) -> None:
    """No posterior uses a prediction whose marks were known to be old when it was used."""
    changes = [*each('transfer="predictor"'), *each("reset_after=2"), *TRUSTING]
    mesh = four(lie("c", "bias", 2.0, 20, 50), *changes)
    mesh.run(120 * 0.02 + 0.4)
    predictions = {m.reference: m for m in mesh.of(Prediction)}
    checked = 0
    for name in FILTERS:
        own = 0
        for posterior in mesh.posteriors(name):
            own = max(own, posterior.epoch)
            for reference in posterior.used:
                if reference[0] == "prediction":
                    marks = {src: epoch for src, _, epoch in predictions[reference].descent}
                    assert marks.get(f"filter/{name}", own) == own
                    checked += f"filter/{name}" in marks
    assert checked > 100


# -- restarts


@pytest.mark.parametrize(
    ("liar", "seed"), [("a", 1), ("a", 2), ("a", 4), *(pytest.param(s, 3, marks=pytest.mark.soak) for s in "abcd")]
)
def test_a_relaxed_fusion_that_starts_late_believes_no_single_source(
    four: Callable[..., Any], liar: str, seed: int
) -> None:
    widen = f'filters.f{liar}.on_inconsistency="widen"'
    mesh = four(lie(liar, "bias", 0.6, 20, 110), widen, DOMAIN, f"mesh.seed={seed}")
    mesh.run(0.9)
    mesh.kill("main")
    mesh.run(0.2)
    node = mesh.start("fusion", "main")
    mesh.run(1.4)
    assert outside(mesh, "main") == []
    late = [p for p in mesh.posteriors("main") if p.boot == node.boot]
    assert late[0].status == "restarted"
    assert len(late[0].used) == len(FILTERS)


def test_a_fusion_that_is_started_again_is_listened_to_although_it_counts_its_epochs_anew(
    four: Callable[..., Any],
) -> None:
    changes = ['filters.fa.transfer="fused"', *each("reset_after=2"), *TRUSTING]
    mesh = four(lie("c", "drift", 0.1, 20, 40), *changes)
    mesh.run(1.2)
    assert mesh.posteriors("main")[-1].epoch > 0
    mesh.kill("main")
    node = mesh.start("fusion", "main")
    mesh.run(1.6)
    last = mesh.newest("fa")[120]
    assert last.gain is not None
    assert node.boot in {boot for topic, _, boot, _ in last.used if topic == "fused"}


def test_a_filter_that_is_started_again_after_a_reset_is_listened_to(four: Callable[..., Any]) -> None:
    mesh = four(lie("c", "bias", 9.0, 20, 40), *each("reset_after=2"), *TRUSTING)
    mesh.run(0.7)
    assert mesh.posteriors("fc")[-1].epoch > 2
    mesh.kill("fc")
    node = mesh.start("filter", "fc")
    mesh.run(2.0)
    used = {(src, boot) for _, src, boot, _ in mesh.newest("main")[120].used}
    assert ("filter/fc", node.boot) in used
    assert outside(mesh, "main", after=60) == []


def test_the_last_set_of_a_source_is_forgotten_with_its_epoch(four: Callable[..., Any]) -> None:
    mesh = four(lie("c", "bias", 9.0, 20, 60), *each("reset_after=3"), *TRUSTING)
    mesh.run(1.2)
    for name, last in mesh.nodes["main"].last.items():
        newest = max(p.epoch for p in mesh.posteriors(name))
        assert last.epoch == newest, "a filter that is started again would start from an abandoned set"


def test_a_filter_that_starts_from_a_set_that_misses_its_data_starts_again_from_something_else(
    four: Callable[..., Any],
) -> None:
    mesh = four(DOMAIN)
    mesh.run(1.0)
    mesh.kill("fb")
    mesh.kill("main")
    (*_, last) = [p for p in mesh.posteriors("fb") if p.status == "ok"]
    far = [90.0] * 3
    fields = {name: getattr(last, name) for name in last.__struct_fields__}
    lie_of_old = fields | {"support": OrthotopeMessage(lower=far, upper=far), "lower": far, "upper": far, "step": 53}
    node = mesh.start("filter", "fb")
    node.deliver(key("four", "posterior", "fb"), encode(type(last)(**lie_of_old)), mesh.now)
    mesh.run(1.8)
    (event,) = [e for e in mesh.events("epoch-left") if e.boot == node.boot]
    assert "contradicts the data" in event.text
    assert mesh.newest("fb")[120].status == "ok"
    assert outside(mesh, "fb") == []


# -- inputs and the domain


def test_an_input_that_is_lost_for_good_is_given_up_where_there_is_a_domain(
    four: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plant, "PAST_SECONDS", 0.0)
    mesh = four("mesh.steps=600", DOMAIN)
    mesh.run(0.5)
    mesh.kill("plant")
    mesh.run(6.5)
    mesh.start("plant", "plant")
    mesh.run(5.4)
    truth = mesh.truth()
    for name in mesh.estimators():
        assert any(e.name == name for e in mesh.events("started-over"))
        assert max(mesh.newest(name)) == 600, name
        assert tail(mesh, name) == {"ok"}
        for p in mesh.posteriors(name):
            if p.step in truth:
                assert all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))


@pytest.mark.parametrize("away", [6.5, 1.0], ids=["longer than its publisher keeps", "short"])
def test_a_hole_of_inputs_is_crossed_in_one_jump(
    four: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, away: float
) -> None:
    """325 or 50 lost inputs: one event, and current a second after it is known that they are lost."""
    monkeypatch.setattr(plant, "PAST_SECONDS", 0.0)
    monkeypatch.setattr(plant, "LEAST_PAST", 0)
    mesh = four("mesh.steps=1000", DOMAIN)
    mesh.run(0.5)
    mesh.kill("plant")
    mesh.run(away)
    mesh.start("plant", "plant")
    known = 0.0 if away > 6.0 else 6.0 - away  # 300 later inputs have come
    mesh.run(known + 1.0)
    newest = max(m.step for m in mesh.of(Input))
    truth = mesh.truth()
    for name in mesh.estimators():
        (event,) = [e for e in mesh.events("started-over") if e.name == name]
        assert re.match(r"the inputs of steps \d+ to \d+ are lost", event.text)
        assert max(mesh.newest(name)) >= newest - 2, name
        for p in mesh.posteriors(name):
            if p.step in truth:
                assert all(low <= x <= high for low, x, high in zip(p.lower, truth[p.step], p.upper, strict=True))


def test_a_set_that_leaves_the_domain_kills_nobody_and_begins_a_new_epoch(mesh_of: MakeMesh, tmp_path: Path) -> None:
    """The prior is wrong: it says that the state flies away."""
    file = tmp_path / "flight.toml"
    file.write_text(
        '[mesh]\nname = "flight"\ndt = 0.1\nsteps = 60\n'
        '[model]\nA = [[1.0, 1.0], [0.0, 1.0]]\nrho = [0.01, 0.01]\nstates = ["x", "v"]\n'
        "prior = { lower = [8.0, 3.0], upper = [8.1, 3.1] }\ndomain = { lower = [-9.0, -9.0], upper = [9.0, 9.0] }\n"
        "[plant]\nx1 = [0.0, 0.0]\n"
        '[sensors.s]\nC = [[1.0, 0.0]]\nr = [0.2]\n[filters.f]\nkind = "LSUPB"\nsensors = ["s"]\n'
    )
    mesh = mesh_of(file=file)
    mesh.run(60 * 0.1 + 0.4)
    (event,) = mesh.events("reset")
    assert "domain" in event.text
    newest = mesh.newest("f")
    assert list(newest) == list(range(1, 61))
    assert (newest[1].status, newest[2].status, newest[3].status) == ("inconsistent", "restarted", "ok")
    assert (newest[2].base, newest[60].epoch) == ("domain", 1)
    assert outside(mesh, "f") == []


# -- transfers against data


def test_a_transfer_that_the_data_contradict_gives_way_to_them(four: Callable[..., Any]) -> None:
    """The lie overlaps the prediction and misses the truth; the filter's own measurement is not blamed for it."""
    mesh = four(*each('transfer="predictor"', ["fb"]), 'filters.fb.transfer_from=["fa"]')
    mesh.kill("fa")
    mesh.run(0.75)
    own = next(m for m in mesh.of(Prediction, "fb") if m.step == 39)
    lower, upper = list(own.lower), list(own.upper)
    lower[1] = upper[1] - 0.02 * (upper[1] - lower[1])
    lower[2] = upper[2] - 0.02 * (upper[2] - lower[2])
    corner = Prediction(
        v=1, src="filter/fa", boot="f" * 16, seq=0, step=39, sent_ns=1, origin_ns=1, model=mesh.configuration.digest(),
        support=OrthotopeMessage(lower=lower, upper=upper), lower=lower, upper=upper,
        y_lower=[0.0], y_upper=[1.0], y_point=[0.5], epoch=0, guarantee="declared",
    )  # fmt: skip
    mesh.hand_over(key("four", "prediction", "fa"), encode(corner))
    mesh.run(1.0)
    (event,) = mesh.events("transfer-rejected")
    assert "contradicts the data" in event.text
    posterior = mesh.newest("fb")[39]
    assert posterior.status == "ok"
    assert {topic for topic, *_ in posterior.used} == {"input", "measurement"}
    assert outside(mesh, "fb") == []


# -- what a guarantee is worth


def test_a_family_chosen_among_sources_that_contradict_one_another_is_no_guarantee(four: Callable[..., Any]) -> None:
    widen = 'filters.fc.on_inconsistency="widen"'
    mesh = four(lie("c", "bias", 4.0, 30, 60), widen, *TRUSTING)
    mesh.run(120 * 0.02 + 0.4)
    first = min(e.step for e in mesh.events("source-rejected"))
    newest = mesh.newest("main")
    assert newest[first - 1].guarantee == "declared"
    assert newest[first].guarantee == "learned"


def test_a_relaxed_set_is_declared_as_long_as_no_more_sources_than_may_lie_are_learned(
    four: Callable[..., Any],
) -> None:
    widen = each('on_inconsistency="widen"')
    one = four(lie("c", "bias", 4.0, 30, 60), *widen)
    one.run(120 * 0.02 + 0.4)
    assert one.newest("fc")[120].guarantee == "learned"
    assert {p.guarantee for p in one.posteriors("main")} == {"declared"}
    two = four(lie("c", "bias", 4.0, 30, 60), lie("a", "bias", 4.0, 30, 60), *widen)
    two.run(120 * 0.02 + 0.4)
    assert two.newest("main")[120].guarantee == "learned"


# -- the marks themselves


def prediction(src: str, boot: str, epoch: int, descent: Sequence[tuple[str, str, int]] = ()) -> Prediction:
    box = OrthotopeMessage(lower=[0.0], upper=[1.0])
    return Prediction(
        v=1, src=src, boot=boot, seq=0, step=1, sent_ns=0, origin_ns=0, model="m", support=box, lower=[0.0],
        upper=[1.0], y_lower=[], y_upper=[], y_point=[], epoch=epoch, guarantee="declared", descent=list(descent),
    )  # fmt: skip


def test_an_epoch_that_was_relied_on_through_another_peer_is_left_too() -> None:
    epochs = Epochs("filter/me", "0" * 16)
    epochs.add_dependency(prediction("filter/b", "b" * 16, 0, [("filter/c", "c" * 16, 2)]))
    assert epochs.descent == [("filter/b", "b" * 16, 0), ("filter/c", "c" * 16, 2)]
    epochs.record(prediction("filter/d", "d" * 16, 0, [("filter/c", "c" * 16, 3)]))
    assert epochs.abandoned == "filter/c"
    epochs.begin()
    assert epochs.abandoned is None
    assert epochs.descent == []
    assert epochs.is_abandoned(prediction("filter/b", "b" * 16, 0, [("filter/c", "c" * 16, 2)]))
    assert epochs.is_abandoned(prediction("filter/b", "b" * 16, 1, [("filter/me", "0" * 16, 0)]))
    assert not epochs.is_abandoned(prediction("filter/b", "b" * 16, 1, [("filter/c", "c" * 16, 3)]))


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 3)), max_size=200))
def test_what_was_relied_on_is_remembered_however_many_boots_come(messages: list[tuple[int, int]]) -> None:
    epochs = Epochs("filter/me", "0" * 16)
    epochs.add_dependency(prediction("filter/b", "b" * 16, 1))
    for boot, epoch in messages:
        epochs.record(prediction("filter/b", f"{boot:016x}", epoch))
    assert epochs.abandoned is None
    epochs.record(prediction("filter/b", "b" * 16, 2))
    assert epochs.abandoned == "filter/b"


# -- what a replay needs


def test_a_step_that_is_done_again_finds_the_inputs_by_which_an_old_fused_box_was_carried(
    four: Callable[..., Any],
) -> None:
    """The box used at step 30 is of step 20; the measurement of step 30 comes when only few steps are remembered."""
    kept: list[tuple[str, bytes]] = []

    def carry(address: str, payload: bytes, node: Any) -> bool:
        if node.name != "fb":
            return True
        message = node.admission.__class__(node.configuration, {"fused", "measurement"}).admit(address, payload)
        if message is None or not (message.topic == "fused" and 20 < message.step < 40):
            is_late = message is not None and message.topic == "measurement" and message.step == 30 and not kept
            if is_late:
                kept.append((address, payload))
            return not is_late
        return False

    mesh = four('filters.fb.transfer="fused"', "filters.fb.history=4", carry=carry)
    mesh.run(0.635)
    node = mesh.nodes["fb"]
    assert node.current is not None
    assert node.current > 31
    mesh.publish(node, node.deliver(*kept[0], mesh.now))
    mesh.run(2.0)
    again = mesh.newest("fb")[30]
    assert (again.revision, again.status) == (1, "ok")
    assert any(topic == "fused" for topic, *_ in again.used)
    assert max(mesh.newest("fb")) == 120
