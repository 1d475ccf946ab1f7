"""``[filters.NAME]``: options of classes, also of other people's, and the old name of a key."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import pytest

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.filters.registry import FILTERS
from lsu_mesh.mesh.config import Configuration, ConfigurationError, Problem, filters, load, load_values
from lsu_mesh.mesh.config.filter_options import FilterOptions
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

if TYPE_CHECKING:
    from somewhere_else import Unimported  # type: ignore[import-not-found]


class Own(LSUO):
    """A filter of somebody else."""

    def __init__(
        self,
        model: LSUModel,
        prior: Support,
        *,
        gain: float,
        shape: Literal["round", "flat"] = "round",
        limits: Orthotope | None = None,
        rows: tuple[int, ...] = (),
    ) -> None:
        if gain > 1e6:
            raise ValueError("far too large")
        self.given = (gain, shape, limits, rows)
        super().__init__(model, prior)


class Unannotated(LSUO):
    """A filter whose annotations are for type checkers only, and that takes any option."""

    def __init__(self, model: LSUModel, prior: Support, size: Unimported = 1, **more: Any) -> None:
        if more.get("bad"):
            raise ModelError("bad must not be given")
        super().__init__(model, prior)


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    """``kind = "own:Own"`` and ``"own:Unannotated"`` name the classes above."""
    classes: Mapping[str, type[Filter]] = {"own:Own": Own, "own:Unannotated": Unannotated}
    real = filters.filter_class

    def found(kind: str) -> type[Filter]:
        return classes[kind] if kind in classes else real(kind)

    monkeypatch.setattr(filters, "filter_class", found)


def records(file: Path, *overrides: str) -> dict[str, Problem]:
    with pytest.raises(ConfigurationError) as caught:
        load(file, overrides)
    return {one.key: one for one in caught.value.records}


def test_options_of_a_class_of_somebody_else_are_converted_by_its_annotations(own: None, demo: Path) -> None:
    given = 'filters.box={kind="own:Own", sensors=["s1"], gain=2, limits={lower=[0.0], upper=[1.0]}, rows=[1, 2]}'
    settings = load(demo, [given]).filters["box"]
    assert settings.options["rows"] == (1, 2)
    assert (settings.kind, settings.options["gain"]) == ("own:Own", 2.0)
    assert isinstance(settings.options["gain"], float)
    assert isinstance(settings.options["limits"], Orthotope)


def test_mistakes_of_a_class_of_somebody_else_are_told_like_others(own: None, demo: Path) -> None:
    found = records(demo, 'filters.box={kind="own:Own", sensors=["s1"], shape="flet", rows=[1, 2.0], gian=1}')
    assert set(found) == {"gain", "shape", "rows", "gian"}
    assert found["gain"].text == "is missing; expected a finite number"
    assert (found["shape"].nearest, found["gian"].nearest) == ("flat", "gain")
    assert "item 2: expected a whole number, found 2.0; write 2" in found["rows"].text


def test_any_error_of_a_constructor_is_a_mistake_of_the_file(own: None, demo: Path) -> None:
    (one,) = records(demo, 'filters.box={kind="own:Own", sensors=["s1"], gain=1e7}').values()
    assert (one.table, one.key) == ("filters.box", "gain")
    assert "ValueError: far too large" in one.text


def test_a_class_without_annotations_checks_for_itself(own: None, demo: Path) -> None:
    loaded = load(demo, ['filters.box={kind="own:Unannotated", sensors=["s1"], size="x", more=3}'])
    assert loaded.filters["box"].options == {"size": "x", "more": 3}
    (one,) = records(demo, 'filters.box={kind="own:Unannotated", sensors=["s1"], bad=1}').values()
    assert (one.key, one.text) == ("bad", "must not be given")


@pytest.mark.parametrize("kind", ["nowhere:Filter", ":", "a:", "LSU0", "", 3])
def test_a_kind_that_names_no_class_is_a_mistake_at_its_key(demo: Path, kind: object) -> None:
    found = records(demo, f"filters.box.kind={json.dumps(kind)}")
    assert set(found) == {"kind"}
    assert found["kind"].expected.startswith("one of ")


@pytest.mark.parametrize("kind", sorted(FILTERS))
def test_every_option_of_this_library_has_an_expectation(kind: str) -> None:
    own_options = FilterOptions(filters.filter_class(kind))
    for name in own_options.names:
        assert own_options.expected(name).words != "a value that the class takes", name


def test_a_mistake_elsewhere_does_not_hide_one_of_the_constructor(demo: Path) -> None:
    found = records(demo, "filters.cz.max_generators=1", "filters.cz.deadline=5", "recorder.flush=1", "mesh.sed=2")
    assert set(found) == {"max_generators", "deadline", "flush", "sed"}


def test_the_old_name_of_a_key_is_read(demo: Path) -> None:
    assert load(demo, ["filters.box.on_contradiction=widen"]).filters["box"].on_inconsistency == "widen"
    (one,) = records(demo, "filters.box.on_contradiction=wide").values()
    assert (one.key, one.nearest) == ("on_contradiction", "widen")


def with_old_key(demo: Path) -> Configuration:
    return load(demo, ["filters.box.on_contradiction=hold"])


def test_a_recording_that_holds_the_old_name_is_read_and_a_flag_beats_it(demo: Path) -> None:
    values = with_old_key(demo).values
    assert values["filters"]["box"]["on_contradiction"] == "hold"
    assert load_values(values, demo).filters["box"].on_inconsistency == "hold"
    for key in ("on_inconsistency", "on_contradiction"):
        assert load_values(values, demo, [f"filters.box.{key}=widen"]).filters["box"].on_inconsistency == "widen"


def test_both_names_of_a_key_are_a_mistake(demo: Path, tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    both = 'kind = "LSUO"\non_contradiction = "hold"\non_inconsistency = "hold"'
    file.write_text(demo.read_text().replace('kind = "LSUO"', both))
    (one,) = records(file).values()
    assert one.key == "on_contradiction"
    assert "old name of on_inconsistency" in one.text


def test_a_transfer_is_a_word_or_a_table(demo: Path, tmp_path: Path) -> None:
    plain = load(demo, ["filters.box.transfer=predictor"]).filters["box"]
    assert (plain.transfer, plain.transfer_gain, plain.publish_when) == ("predictor", "hull", 0.0)
    file = tmp_path / "mesh.toml"
    table = 'transfer = {way = "predictor", gain = "support", publish_when = 0.5}'
    file.write_text(demo.read_text().replace('kind = "LSUO"', f'kind = "LSUO"\n{table}'))
    full = load(file).filters["box"]
    assert (full.transfer, full.transfer_gain, full.publish_when) == ("predictor", "support", 0.5)
    assert full.transfer_from == plain.transfer_from
    sender = load(demo, ["filters.cz.transfer.publish_when=1"]).filters["cz"]
    assert (sender.transfer, sender.publish_when) == ("off", 1.0), "who takes nothing may send on gain"


def test_a_flag_reaches_into_a_transfer_that_is_written_as_a_word(demo: Path, tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(demo.read_text().replace('kind = "LSUO"', 'kind = "LSUO"\ntransfer = "predictor"'))
    found = load(file, ["filters.box.transfer.gain=support"]).filters["box"]
    assert (found.transfer, found.transfer_gain) == ("predictor", "support")
    assert load(file, ["filters.box.transfer=fused"]).filters["box"].transfer == "fused"


@pytest.mark.parametrize(
    ("change", "key", "expected", "words"),
    [
        ("transfer.publish_when=-0.1", "publish_when", "a number of nats ≥ 0", "found -0.1"),
        ('transfer.publish_when="often"', "publish_when", "a number of nats ≥ 0", 'found "often"'),
        ("transfer.gain=volume", "gain", 'one of "support", "hull"', '"volume" is no choice'),
        ("transfer.gain=support", "gain", "no such key here", 'has no effect with way = "off"'),
        ("transfer.way=predictr", "way", 'one of "off", "predictor"', 'did you mean "predictor"'),
        ("transfer.when=1", "when", "one of gain, publish_when, way", "unknown key"),
        ("transfer=predictr", "transfer", 'one of "off", "predictor"', 'did you mean "predictor"'),
    ],
)
def test_mistakes_of_a_transfer_say_what_is_expected(
    demo: Path, change: str, key: str, expected: str, words: str
) -> None:
    found = records(demo, f"filters.box.{change}")
    assert set(found) == {key}
    assert found[key].expected.startswith(expected)
    assert words in found[key].text
