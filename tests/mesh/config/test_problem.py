"""Mistakes as records: their fields, their lines, and where the value came from."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lsu_mesh.mesh.config import ConfigurationError, Problem, load
from lsu_mesh.mesh.config.measurement_files import PlayedFileError, accounts
from lsu_mesh.mesh.config.mesh_table import DT


def records(file: Path, *overrides: str, environment: dict[str, str] | None = None) -> tuple[Problem, ...]:
    with pytest.raises(ConfigurationError) as caught:
        load(file, overrides, environment)
    return caught.value.records


@pytest.fixture
def wrong(demo: Path, tmp_path: Path) -> Path:
    """The demo with mistakes in four tables."""
    text = demo.read_text()
    for old, new in (
        ('kind = "LSUO"', 'kind = "LSUO"\nmeet = "no"\nhull = "strip"'),
        ("max_generators = 20\nmax_constraints = 8", "max_generators = 20.5\nmax_constraints = -1"),
        ("seed = 1", "sed = 1"),
        ("[fusion.main]", '[fusion.main]\npolicy = "relax"'),
        ("x1 = [1.0, 0.5, -0.5]", "x1 = [\n  1.0,\n  0.5\n]"),
    ):
        assert old in text, old
        text = text.replace(old, new, 1)
    file = tmp_path / "mesh.toml"
    file.write_text(text)
    return file


def test_mistakes_of_all_tables_come_together_each_with_its_line(wrong: Path) -> None:
    found = {(one.table, one.key): one for one in records(wrong)}
    assert set(found) == {
        ("filters.box", "meet"), ("filters.box", "hull"), ("filters.cz", "max_generators"),
        ("filters.cz", "max_constraints"), ("mesh", "sed"), ("fusion.main", "policy"), ("plant", "x1"),
    }  # fmt: skip
    lines = wrong.read_text().splitlines()
    for (_, key), one in found.items():
        assert one.line is not None
        assert lines[one.line - 1].startswith(f"{key} ="), str(one)
        assert str(one).startswith(f"{wrong}: line {one.line}: [{one.table}] {key}: ")


def test_a_record_says_what_was_found_what_was_expected_and_what_is_nearest(wrong: Path) -> None:
    found = {one.key: one for one in records(wrong)}
    assert (found["meet"].found, found["meet"].expected, found["meet"].nearest) == ('"no"', "true or false", None)
    assert found["meet"].text == 'expected true or false, found "no"; write false'
    assert (found["hull"].expected, found["hull"].nearest) == ('one of "strips", "lp"', "strips")
    assert (found["max_generators"].found, found["max_generators"].expected) == ("20.5", "a whole number")
    assert found["max_constraints"].found == "-1"
    assert "negative" in found["max_constraints"].text, "what the constructor says stands at its key"
    assert (found["sed"].nearest, found["policy"].nearest) == ("seed", "relaxed")
    assert found["policy"].expected == 'one of "intersect", "relaxed"'


def test_a_record_becomes_a_line_of_json(wrong: Path) -> None:
    fields = {"level", "file", "table", "key", "found", "expected", "nearest", "line", "text", "source"}
    for one in records(wrong):
        line = json.loads(json.dumps(one.as_record()))
        assert set(line) == fields
        assert (line["level"], line["file"], line["source"]) == ("mistake", str(wrong), None)


def test_what_the_constructor_refuses_is_told_option_by_option(demo: Path) -> None:
    found = records(demo, "filters.cz.max_generators=1", "filters.cz.max_constraints=-2", "mesh.seed=-1")
    assert {(one.table, one.key, one.found) for one in found} == {
        ("filters.cz", "max_generators", "1"), ("filters.cz", "max_constraints", "-2"), ("mesh", "seed", "-1"),
    }  # fmt: skip
    assert next(one.expected for one in found if one.key == "max_generators") == "at least 3, the number of states"


def test_a_value_of_a_flag_is_said_to_come_from_it(demo: Path) -> None:
    (one,) = records(demo, "filters.box.meet=no")
    assert (one.source, one.line) == ("-X filters.box.meet=no", None)
    assert str(one).endswith('[filters.box] meet: expected true or false, found "no"; write false'
                             " (from -X filters.box.meet=no)")  # fmt: skip


def test_a_value_of_the_environment_is_said_to_come_from_it(demo: Path) -> None:
    (one,) = records(demo, environment={"LSU_MESH_FILTERS__BOX__MEET": "no"})
    assert (one.table, one.key, one.source) == ("filters.box", "meet", "LSU_MESH_FILTERS__BOX__MEET")
    (one,) = records(demo, environment={"LSU_MESH_SUPERVISO__LIMIT": "3"})
    assert (one.key, one.nearest, one.source) == ("superviso", "supervisor", "LSU_MESH_SUPERVISO__LIMIT")


def test_the_flag_that_beats_the_environment_is_the_one_that_is_named(demo: Path) -> None:
    (one,) = records(demo, "mesh.seed=x", environment={"LSU_MESH_MESH__SEED": "y"})
    assert (one.found, one.source) == ('"x"', "-X mesh.seed=x")


def test_flags_that_are_none_are_told_with_the_other_mistakes(demo: Path) -> None:
    found = [str(one) for one in records(demo, "mesh.steps", "seed=3", "mesh..x=1", "mesh.seed=-1", "mesh.dt.x=1")]
    assert len(found) == 5, found
    assert sum("expected table.key=value" in line for line in found) == 4


def test_a_secret_in_a_flag_is_not_repeated(demo: Path) -> None:
    (one,) = records(demo, 'network.tls.key="-----BEGIN PRIVATE KEY-----abc"')
    assert "abc" not in json.dumps(one.as_record())


def test_a_key_that_is_missing_is_said_at_its_table(demo: Path, tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(demo.read_text().replace("dt = 0.02", "", 1))
    (one,) = records(file)
    assert (one.table, one.key, one.found, one.expected) == ("mesh", "dt", None, DT.words)
    assert file.read_text().splitlines()[(one.line or 0) - 1] == "[mesh]"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[mesh]\nname = demo\n", 2),
        ("[mesh]\n\n\nname = ", 4),
        ("[mesh]\n[mesh]\n", 2),
        (f"a = {'[' * 3000}", None),
        (f"a = {'9' * 5000}", None),
    ],
)
def test_a_file_that_is_no_toml_has_the_line_too(tmp_path: Path, text: str, line: int | None) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(text)
    (one,) = records(file)
    assert (one.line, one.expected, one.file) == (line, "a TOML file", str(file))
    assert "not a TOML file" in str(one)


def test_a_mistake_in_measurements_has_their_file_and_line(demo: Path, tmp_path: Path) -> None:
    (tmp_path / "s1.csv").write_text("step,y\n1,0.5\n2,high\n")
    file = tmp_path / "mesh.toml"
    file.write_text(demo.read_text().replace("C = [[1.0, 0.0, 0.5]]", 'C = [[1.0, 0.0, 0.5]]\nfile = "s1.csv"', 1))
    with pytest.raises(PlayedFileError) as caught:
        accounts(load(file))
    (one,) = caught.value.records
    assert (one.file, one.line, one.table, one.key) == (str(tmp_path / "s1.csv"), 3, "sensors.s1", "file")
    assert str(one).startswith(f"{tmp_path / 's1.csv'}: line 3, column 'y': expected a number")
    assert one.found == "'high'"
    assert set(one.as_record()) == set(Problem("", "", "", "", "").as_record())


def test_a_warning_is_a_record_with_a_line(demo: Path, tmp_path: Path) -> None:
    file = tmp_path / "mesh.toml"
    file.write_text(demo.read_text().replace("[fusion.main]", '[fusion.main]\npolicy = "relaxed"\nfaults = 1'))
    first, second = load(file).warnings
    assert (first.table, first.key, first.found, first.as_record()["level"]) == (
        "fusion.main",
        "faults",
        "1",
        "warning",
    )
    assert first.line == second.line
    assert file.read_text().splitlines()[(first.line or 0) - 1] == "faults = 1"
    assert f"{file}: line {first.line}: warning: [fusion.main] faults: is 1, but sensor 's1' feeds 2" in str(first)
