"""``lsu-mesh bench recording``: batches are cheap and nothing is lost."""

from __future__ import annotations

import json

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.exit_codes import OK
from lsu_mesh_services.recording.cost import measure


def test_batches_cost_a_fraction_and_lose_nothing() -> None:
    found = measure(filters=4, steps=100)
    assert (found.lost, found.problems) == (0, [])
    assert found.messages == 100 * (1 + 3 + 2 * 4 + 1)
    assert found.naive_over_batched > 3, "10 and more with 12 filters; see the command"
    assert found.bytes_per_step > 1000


@pytest.mark.soak
def test_twelve_filters_at_200_hz_take_less_than_a_core(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "recording", "--json"]) == OK
    found = json.loads(capsys.readouterr().out)
    assert found["share_of_one_core"] < 1
    assert found["naive_over_batched"] >= 10
