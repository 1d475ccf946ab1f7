"""Options by annotation: what is taken, what is refused, and the remedy."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, NewType, Optional

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.mesh.config.expected import Unfit
from lsu_mesh.mesh.config.option_types import expected_of
from lsu_mesh.supports.orthotope import Orthotope


class Colour(enum.Enum):
    RED = "red"
    BLUE = "blue"


class Pair(NamedTuple):
    name: str
    count: int


Metres = NewType("Metres", float)
Choice = Literal["strips", "lp"]


@pytest.mark.parametrize(
    ("hint", "value", "converted"),
    [
        (bool, True, True),
        (int, 20, 20),
        (int, -3, -3),
        (float, 20, 20.0),
        (float, 0.5, 0.5),
        (str, "", ""),
        (str, "x", "x"),
        (Path, "a/b", Path("a/b")),
        (Choice, "lp", "lp"),
        (Literal[1, 2], 2, 2),
        (int | None, 3, 3),
        (Optional[int], None, None),  # noqa: UP045 – the old spelling is met in other people's code
        (int | float, 3, 3),
        (float | int, 3, 3),
        (float | str, "x", "x"),
        (bool | int, True, True),
        (Sequence[float], [1, 2.5], [1.0, 2.5]),
        (list[int], [1, 2], [1, 2]),
        (tuple[float, ...], [1, 2], (1.0, 2.0)),
        (tuple[int, str], [1, "a"], (1, "a")),
        (tuple[ArrayLike, ArrayLike], [0.0, math.inf], (0.0, math.inf)),
        (frozenset[str], ["a"], frozenset({"a"})),
        (Mapping[str, int], {"a": 1}, {"a": 1}),
        (ArrayLike, [[1, 2.0], [3, 4]], [[1, 2.0], [3, 4]]),
        (ArrayLike | None, 2.0, 2.0),
        (NDArray[np.float64], [1.0], [1.0]),
        (Iterable[Pair | Sequence[object] | Mapping[str, object]], [["a", 1]], [Pair("a", 1)]),
        (Iterable[Pair], [{"name": "a", "count": 1}], [Pair("a", 1)]),
        (Colour, "blue", Colour.BLUE),
        (Annotated[int, "steps"], 3, 3),
        (Metres, 2, 2.0),
        (Any, {"what": "ever"}, {"what": "ever"}),
        (complex, "left to the class", "left to the class"),
    ],
)
def test_what_fits_is_taken(hint: Any, value: object, converted: object) -> None:
    found = expected_of(hint).convert(value)
    assert found == converted
    assert type(found) is type(converted)


def test_a_box_is_a_table_or_a_pair() -> None:
    for value in ({"lower": [0.0, 1], "upper": [2.0, 3.0]}, [[0.0, 1], [2.0, 3.0]]):
        box = expected_of(Orthotope).convert(value)
        assert [side.tolist() for side in box.bounds()] == [[0.0, 1.0], [2.0, 3.0]]


@pytest.mark.parametrize(
    ("hint", "value", "words"),
    [
        (bool, "no", 'expected true or false, found "no"; write false'),
        (bool, "yes", 'expected true or false, found "yes"; write true'),
        (bool, 1, "expected true or false, found 1; write true"),
        (bool, 0.0, "expected true or false, found 0.0"),
        (int, 20.5, "expected a whole number, found 20.5"),
        (int, 20.0, "expected a whole number, found 20.0; write 20"),
        (int, "20", 'expected a whole number, found "20"; write 20'),
        (int, True, "expected a whole number, found true"),
        (float, True, "expected a finite number, found true"),
        (float, math.nan, "expected a finite number, found nan"),
        (float, math.inf, "expected a finite number, found inf"),
        (float, "0.5", 'expected a finite number, found "0.5"; write 0.5 without quotes'),
        (float, 10**400, "expected a finite number, found 1000"),
        (str, 3, "expected a string, found 3; put it in quotes"),
        (Choice, "strip", '"strip" is no choice; did you mean "strips"? (choices: strips, lp)'),
        (Choice, 3, 'expected one of "strips", "lp", found 3'),
        (Literal[1, 2], True, "expected one of 1, 2, found true"),
        (int | None, "x", 'expected a whole number, found "x"'),
        (int | str, 1.5, "expected a whole number or a string, found 1.5"),
        (list[int], [1, 2.0], "found [1, 2.0]; item 2: expected a whole number, found 2.0; write 2"),
        (list[int], 3, "expected a list, each item a whole number, found 3"),
        (tuple[int, int], [1], "found [1]; it has 1"),
        (tuple[int, int], [1, "x"], 'item 2: expected a whole number, found "x"'),
        (Mapping[str, int], {"a": "x"}, 'a: expected a whole number, found "x"'),
        (ArrayLike, "x", 'expected a number, or a list or matrix of numbers, found "x"'),
        (ArrayLike, [[1.0], [1.0, 2.0]], "its rows have different lengths"),
        (ArrayLike, [True], "expected a number, or a list or matrix of numbers, found [true]"),
        (ArrayLike, math.nan, "found nan"),
        (Iterable[Pair | Sequence[object]], [["a", 1.5]], "item 1: expected a list [name, count]"),
        (Iterable[Pair], [{"name": "a"}], "it has the keys name"),
        (Colour, "rot", '"rot" is no choice'),
        (Orthotope, {"lower": [1.0]}, "expected a box"),
        (Orthotope, {"lower": [1.0], "upper": [0.0]}, "lower must not exceed upper"),
    ],
)
def test_what_does_not_fit_is_refused_with_a_remedy(hint: Any, value: object, words: str) -> None:
    expected = expected_of(hint)
    with pytest.raises(Unfit) as caught:
        expected.convert(value)
    assert words in expected.explain(value, caught.value)
