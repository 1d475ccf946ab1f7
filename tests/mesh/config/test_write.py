"""TOML text of values gives the values back."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.config.write import to_toml

KEYS = st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc")), min_size=1, max_size=8)
PLAIN = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False),
    st.text(st.characters(codec="utf-8", exclude_categories=("Cs",)), max_size=12),
)
VALUES = st.recursive(
    PLAIN, lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(KEYS, inner, max_size=3))
)


@given(st.dictionaries(KEYS, VALUES, max_size=4))
def test_any_values_come_back(values: dict[str, Any]) -> None:
    assert tomllib.loads(to_toml(values)) == values


def test_numbers_that_are_not_finite() -> None:
    back = tomllib.loads(to_toml({"a": [math.inf, -math.inf, math.nan]}))["a"]
    assert back[:2] == [math.inf, -math.inf]
    assert math.isnan(back[2])


@pytest.mark.parametrize("file", ["services/lsu_mesh_services/demo.toml", "examples/mesh.toml", "examples/liar.toml"])
def test_a_configuration_comes_back(root: Path, tmp_path: Path, file: str) -> None:
    configuration = load(root / file)
    (tmp_path / "again.toml").write_text(to_toml(configuration.values), encoding="utf-8")
    again = load(tmp_path / "again.toml")
    assert again.values == configuration.values
    assert again.digest() == configuration.digest()
