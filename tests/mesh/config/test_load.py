"""A configuration's mistakes: all at once, each with file, place, value and remedy."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from lsu_mesh.mesh.config import ConfigurationError, load

Problems = Callable[..., list[str]]


@pytest.fixture
def problems(demo: Path, tmp_path: Path) -> Problems:
    """Problems of the demo after replacements of its text."""

    def find(*replacements: tuple[str, str], overrides: list[str] | None = None) -> list[str]:
        text = demo.read_text()
        for old, new in replacements:
            assert old in text, old
            text = text.replace(old, new, 1)
        file = tmp_path / "mesh.toml"
        file.write_text(text)
        with pytest.raises(ConfigurationError) as caught:
            load(file, overrides or [])
        return [without_line(line.removeprefix(f"{tmp_path}/")) for line in caught.value.problems]

    return find


def without_line(text: str) -> str:
    """A problem's text without the line, of which ``test_problem.py`` knows more."""
    return re.sub(r"^mesh\.toml: line \d+: ", "mesh.toml: ", text)


def test_the_demo_is_valid_and_sensors_are_in_the_order_of_their_names(demo: Path) -> None:
    configuration = load(demo)
    assert list(configuration.sensors) == ["s1", "s2", "s3"]
    assert configuration.model(["s3", "s1"]).C.tolist() == [[1.0, 0.0, 0.5], [1.0, -1.0, 0.3]]
    assert configuration.mesh.rate == 50.0


def test_all_mistakes_are_told_at_once(problems: Problems) -> None:
    found = problems(
        ('kind = "LSUP"', 'kind = "LSUQ"'),
        ("seed = 1", 'seed = "one"'),
        ("r = [0.3]", "r = [0.3, 0.4]"),
        ('sensors = ["s2", "s3"]', 'sensors = ["s2", "s4"]'),
        ("[recorder]", "[recorde]"),
    )
    text = "\n".join(found)
    assert len(found) == 5, text
    assert 'mesh.toml: [filters.para] kind: "LSUQ" is no choice; did you mean "LSU' in text
    assert 'mesh.toml: [mesh] seed: expected a whole number ≥ 0, found "one"' in text
    assert "mesh.toml: [sensors.s1] r: expected 1 half-widths, one per row of C, found 2" in text
    assert 'mesh.toml: [filters.cz] sensors: "s4" is not defined; did you mean "s' in text
    assert 'mesh.toml: recorde: unknown key; did you mean "recorder"?' in text


def test_all_mistakes_of_a_model_are_told_at_once_and_sensors_are_checked_beside_them(problems: Problems) -> None:
    found = problems(
        ("rho = [0.1, 0.1, 0.1]", 'rho = [0.1]\nstates = ["a", "b"]'),
        ("upper = [5.0, 5.0, 5.0]", "upper = [-9.0, 5.0, 5.0]"),
        ("C = [[1.0, 0.0, 0.5]]", "C = [[1.0, 0.0]]"),
    )
    expected = (
        "[model.prior] lower: must",
        "[model] rho: must have 3",
        "[model] states: must have 3",
        "[sensors.s1] C: expected 3",
    )
    assert len(found) == len(expected), found
    for line, words in zip(found, expected, strict=True):
        assert line.startswith(f"mesh.toml: {words}"), line


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("dt = 0.02", "dt = 0", '[mesh] dt: expected a number > 0, or a fraction such as "1/30", found 0'),
        ("dt = 0.02", "dt = nan", '[mesh] dt: expected a number > 0, or a fraction such as "1/30", found nan'),
        ("dt = 0.02", "", "[mesh] dt: is missing; expected a number > 0"),
        ('name = "demo"', 'name = "a/b"', "[mesh] name: \"a/b\" is no name; expected 1 to 64 ASCII letters"),
        ("rho = [0.1, 0.1, 0.1]", "rho = [0.1]", "[model] rho: must have 3 entries, one per process noise"),
        ("rho = [0.1, 0.1, 0.1]", "rho = [0.1, -0.1, 0.1]", "[model] rho: must be finite and not negative"),
        ("[0.5, 0.1, 0.0]", "[0.5, 0.1]", "[model] A: expected a matrix: a list of rows of one length"),
        ("upper = [5.0, 5.0, 5.0]", "upper = [-9.0, 5.0, 5.0]", "[model.prior] lower: must not exceed upper"),
        ("C = [[1.0, 0.0, 0.5]]", "C = [[1.0, 0.0]]", "[sensors.s1] C: expected 3 columns, one per state, found 2"),
        ("r = [0.3]", "r = [-0.3]", "[sensors.s1] r: half-widths must not be negative"),
        ('kind = "LSUO"', 'kind = "LSUO"\nmeat = true', '[filters.box] meat: unknown key; did you mean "meet"?'),
        ('kind = "LSUO"', 'kind = "LSUO"\ndeadline = "5 parsecs"', "[filters.box] deadline: expected a duration"),
        ('kind = "LSUP"', 'kind = "LSUP"\ntime_update = "edge"', '[filters.para] time_update: "edge" is no choice;'),
        ("max_generators = 20", "max_generators = 1", "[filters.cz] max_generators: must be at least 3"),
        ('"para", "cz"]', '"para", "zc"]', '[fusion.main] sources: "zc" is not defined; did you mean "cz"?'),
        ('"para", "cz"]', '"para", "cz"]\nfaults = 1', '[fusion.main] faults: is 1, but policy = "intersect" trusts'),
        ("[filters.box]", "[filters.s1]", '[filters.s1]: two peers are called "s1", here and in [sensors.s1]'),
        ("[fusion.main]", "[fusion.main]\nsource = []", '[fusion.main] source: unknown key; did you mean "sources"?'),
        ("x1 = [1.0, 0.5, -0.5]", "x1 = [1.0]", "[plant] x1: expected 3 numbers, one per state, found 1"),
        ("[recorder]", '[network]\nentry = "localhost"\n[recorder]', '[network] entry: "localhost" is no endpoint'),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_place_value_and_remedy(problems: Problems, old: str, new: str, expected: str) -> None:
    assert any(f"mesh.toml: {expected}" in line for line in problems((old, new))), problems((old, new))


def test_a_file_that_is_no_toml_names_the_line(tmp_path: Path) -> None:
    file = tmp_path / "broken.toml"
    file.write_text("[mesh]\nname = demo\n")
    with pytest.raises(ConfigurationError, match=r"broken\.toml: line 2: not a TOML file: .*at line 2, column 8"):
        load(file)


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"nowhere\.toml: cannot be read: No such file"):
        load(tmp_path / "nowhere.toml")


def with_file(tmp_path: Path, demo: Path, csv: str, keys: str) -> list[str]:
    (tmp_path / "s1.csv").write_text(csv)
    text = demo.read_text().replace("C = [[1.0, 0.0, 0.5]]", f'C = [[1.0, 0.0, 0.5]]\nfile = "s1.csv"\n{keys}', 1)
    (tmp_path / "mesh.toml").write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        load(tmp_path / "mesh.toml")
    return [without_line(line.removeprefix(f"{tmp_path}/")) for line in caught.value.problems]


def test_a_missing_column_is_told_with_those_that_are_there(tmp_path: Path, demo: Path) -> None:
    found = with_file(tmp_path, demo, "k,y,z\n1,0.5,3\n", 'columns = ["w"]')
    assert found == [
        "s1.csv: line 1: there is no column 'step'; the columns are k, y, z",
        "s1.csv: line 1: there is no column 'w'; the columns are k, y, z",
    ]


def test_a_file_by_time_needs_a_start_time(tmp_path: Path, demo: Path) -> None:
    found = with_file(tmp_path, demo, "t,y\n1,0.5\n", 'time = "t"')
    assert found == [
        "mesh.toml: [mesh] start_time: is missing; files with a time column need it: step k is at start_time + k dt"
    ]


def test_mistakes_in_a_file_and_in_the_configuration_come_together(tmp_path: Path, demo: Path) -> None:
    found = with_file(tmp_path, demo, "k,y\n1,high\n", 'colums = ["y"]')
    assert len(found) == 2
    assert any('did you mean "columns"?' in line for line in found)


def test_flags_beat_the_environment_and_that_beats_the_file(demo: Path) -> None:
    environment = {"LSU_MESH_MESH__STEPS": "70", "LSU_MESH_MESH__SEED": "5", "LSU_MESH_PARENT": "1"}
    configuration = load(demo, ["mesh.steps=80"], environment)
    assert (configuration.mesh.steps, configuration.mesh.seed) == (80, 5)
    assert load(demo).mesh.steps == 600


def test_an_override_that_is_none_is_said(demo: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"-X mesh\.steps: expected table\.key=value"):
        load(demo, ["mesh.steps"])


def test_a_shared_sensor_in_a_relaxed_fusion_is_warned_of(demo: Path) -> None:
    configuration = load(demo, ['fusion.main.policy="relaxed"', "fusion.main.faults=1"])
    first, second = configuration.warnings
    assert "sensor 's1' feeds 2 sources (box, para)" in str(first)
    assert "sensor 's2' feeds 2 sources (box, cz)" in str(second)


def test_the_digest_sees_the_model_and_the_rows_but_not_the_bounds(demo: Path) -> None:
    plain = load(demo).digest()
    assert load(demo, ["sensors.s1.r=[0.9]", "model.rho=[0.2, 0.2, 0.2]"]).digest() == plain
    assert load(demo, ["sensors.s1.C=[[1.0, 0.0, 0.25]]"]).digest() != plain
    assert load(demo, ["model.B=[[0.1], [0.6], [0.4]]"]).digest() != plain
