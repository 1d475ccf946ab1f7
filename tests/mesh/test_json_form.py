"""JSON that JavaScript reads without loss."""

from __future__ import annotations

import json
from typing import Any

import pytest
from msgspec import structs

from lsu_mesh.mesh.json_form import dumps, estimate, whole
from lsu_mesh.mesh.message_examples import bank_example, example
from lsu_mesh.mesh.messages import TYPES, Posterior

SAFE = 2**53
"""Larger integers are no integers in JavaScript."""


def numbers(value: Any) -> list[float]:
    if isinstance(value, dict):
        return [number for inner in value.values() for number in numbers(inner)]
    if isinstance(value, list):
        return [number for inner in value for number in numbers(inner)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []


@pytest.mark.parametrize("topic", TYPES)
def test_no_number_of_a_whole_message_is_too_large(topic: str) -> None:
    told = json.loads(dumps(whole(example(topic), 1_700_000_000_030_000_001)))
    assert told["arrival_ns"] == "1700000000030000001"
    assert told["sent_ns"] == "1700000000020000000"
    assert told["seq"] == "41"
    assert (told["topic"], told["name"], told["step"]) == (topic, "box", 42)
    assert all(abs(number) < SAFE for number in numbers(told))


def test_times_that_an_event_is_about_are_strings_too() -> None:
    event = structs.replace(example("event"), about={"start_ns": 1_700_000_000_000_000_001, "gap": 0.5, "step": 3})
    assert whole(event, 1)["about"] == {"start_ns": "1700000000000000001", "gap": 0.5, "step": 3}


def test_what_an_event_is_about_may_have_the_names_of_references() -> None:
    about: dict[str, str | int | float | None] = {"used": "0123456789abcdef", "base": "prior"}
    assert whole(structs.replace(example("event"), about=about), 1)["about"] == about


def test_a_whole_posterior_has_its_set_and_provenance() -> None:
    told = whole(example("posterior"), 1)
    assert told["support"] == {"type": "orthotope", "lower": [-0.25, 0.5], "upper": [0.75, 1.0]}
    assert told["base"] == ["posterior", "filter/box", "0123456789abcdef", "40"]
    assert told["used"][1] == ["measurement", "sensor/s1", "8899aabbccddeeff", "41"]


def test_an_estimate_has_bounds_and_point_without_them() -> None:
    message = example("fused")
    assert isinstance(message, Posterior)
    told = json.loads(dumps(estimate(message, 7)))
    assert (told["lower"], told["upper"], told["point"]) == ([-0.25, 0.5], [0.75, 1.0], [0.25, 0.75])
    assert told["rejected"] == [{"source": "cz", "reason": "disjoint"}]
    assert not {"support", "used", "base", "covariance"} & set(told)


def test_arrays_of_a_bank_are_rows_and_statuses_words() -> None:
    told = json.loads(dumps(whole(bank_example("bank_posterior"), 1)))
    assert told["lower"] == [[-0.25, 0.5], [3.0, 4.0]]
    assert told["statuses"] == ["ok", "predicted"]
    assert (told["name"], told["center"], told["seq"]) == ("targets", None, "41")
    assert whole(bank_example("bank_measurement"), 1)["y"] == [[0.7], [None]]
