"""The line of each key: against the text itself, whose values are all different."""

from __future__ import annotations

import random
import tomllib
from typing import Any

import pytest

from lsu_mesh.mesh.config.toml_lines import key_lines
from lsu_mesh.mesh.config.write import to_toml

TEXT = '''# a comment with [a.table] and key = 1
top = "a # no comment"   # key = 2
a.b."c d" = 3
"quoted key" = 'x = "y"'

[filters.box]            # [filters.no]
kind = "LSUO"
options = { meet = true, deep.er = [1, 2], list = [
  { x = 1 },   # }
  { x = 2, y = "]" },
] }
text = """
[not.a.table]
key = "4" \\""" still
"""
literal = \'\'\'
other = 5\'\'\'
matrix = [
  [1.0, 2.0],  # ]
  [3.0, 4.0],
]
date = 1979-05-27 07:32:00
after = 1

[[sensors.s1.faults]]
kind = "bias"
[[sensors.s1.faults]]
kind = "drift"
[sensors.s1.faults.inner]
z = 1
[ filters . "para" ]
kind = "LSUP"
'''


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("top", "top ="),
        ("a.b.c d", "a.b."),
        ("a", "a.b."),
        ("quoted key", '"quoted key" ='),
        ("filters.box", "[filters.box]"),
        ("filters.box.kind", 'kind = "LSUO"'),
        ("filters.box.options", "options ="),
        ("filters.box.options.meet", "options ="),
        ("filters.box.options.deep.er", "options ="),
        ("filters.box.options.list[0].x", "{ x = 1 }"),
        ("filters.box.options.list[1]", "{ x = 2,"),
        ("filters.box.options.list[1].y", "{ x = 2,"),
        ("filters.box.text", 'text = """'),
        ("filters.box.literal", "literal ="),
        ("filters.box.matrix", "matrix = ["),
        ("filters.box.date", "date ="),
        ("filters.box.after", "after = 1"),
        ("sensors.s1.faults", "[[sensors.s1.faults]]"),
        ("sensors.s1.faults[0].kind", 'kind = "bias"'),
        ("sensors.s1.faults[1].kind", 'kind = "drift"'),
        ("sensors.s1.faults[1].inner.z", "z = 1"),
        ("filters.para.kind", 'kind = "LSUP"'),
    ],
)
def test_a_key_is_found_where_it_is_written(path: str, words: str) -> None:
    assert TEXT.splitlines()[key_lines(TEXT)[path] - 1].lstrip().startswith(words)


def test_what_only_looks_like_a_key_is_none() -> None:
    tomllib.loads(TEXT)
    assert {path for path in key_lines(TEXT) if "not" in path or path in ("key", "other", "filters.no", "y")} == set()


def test_lines_are_those_of_the_file_with_windows_line_ends_too() -> None:
    text = TEXT.replace("\n", "\r\n")
    tomllib.loads(text)
    assert key_lines(text) == key_lines(TEXT)


def test_keys_that_share_a_path_get_no_line() -> None:
    lines = key_lines('"a.b" = 1\n[a]\nb = 2\nc = 3\n')
    assert "a.b" not in lines
    assert lines["a.c"] == 4


@pytest.mark.parametrize("text", ["key = [1, 2", "= 3", 'key = "open', "[table", "key = {a = 1", "key = {a 1}"])
def test_a_text_that_cannot_be_followed_gives_no_lines(text: str) -> None:
    assert key_lines(text) == {}


def test_deep_nesting_gives_no_lines_and_no_crash() -> None:
    assert key_lines(f"key = {'[' * 5000}{']' * 5000}") == {}


@pytest.mark.parametrize("seed", range(200))
def test_every_leaf_of_a_random_text_is_on_its_line(seed: int) -> None:
    rng = random.Random(seed)
    marks = iter(range(10**6))
    text = to_toml(tables(rng, marks, 3))
    lines, leaves = key_lines(text), leaves_of(tomllib.loads(text))
    assert {path for path, _ in leaves} <= lines.keys()
    for path, value in leaves:
        assert f"mark{value}" in text.splitlines()[lines[path] - 1]


def tables(rng: random.Random, marks: Any, depth: int) -> dict[str, Any]:
    """Tables in tables; each leaf holds a mark of its own, between characters that mean something in TOML."""
    table: dict[str, Any] = {}
    for number in range(rng.randint(1, 5)):
        key = f"{rng.choice(('k', 'key-', 'a b', 'ü', '#', '=', '[x]', chr(34)))}{number}"
        decoy = rng.choice(("#", "]", "}", '"', "'", "\\", "=", "\n", ",", "{", '"""', "\\u0041"))
        if depth and rng.random() < 0.4:
            table[key] = tables(rng, marks, depth - 1)
        else:
            leaf = f"{decoy}mark{next(marks)}mark{decoy}"
            table[key] = rng.choice((leaf, [leaf, [1.5, decoy]], [1, [decoy], leaf]))
    return table


def leaves_of(table: dict[str, Any], path: str = "") -> list[tuple[str, str]]:
    """Paths of all leaves and their marks."""
    found = []
    for key, value in table.items():
        name = f"{path}.{key}".removeprefix(".")
        found += leaves_of(value, name) if isinstance(value, dict) else [(name, str(value).split("mark")[1])]
    return found
