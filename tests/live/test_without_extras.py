"""A run on an installation without Rerun."""

from __future__ import annotations

from pathlib import Path

import pytest
from lsu_mesh_services.extras import RECORD
from without_modules import without

pytestmark = pytest.mark.live


def test_a_run_without_the_recorders_packages_says_once_that_nothing_is_recorded(start, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    folder = without(("rerun", "pyarrow"), tmp_path / "blocked")
    arguments = ("run", "--json", "--steps", "30", "-X", "network.entry={endpoint}")
    session = start(*arguments, paths=[str(folder)])
    assert session.wait() == 0, session.output[1]
    assert session.output[1].count("nothing is recorded") == 1
    assert f"rerun-sdk, pyarrow not installed: {RECORD.remedy}" in session.output[1]
    assert not list(tmp_path.rglob("*.rrd"))
    assert {row["name"]: row["steps"] for row in session.of("estimator")}["main"] == 30
    refused = start(*arguments, "--record", "x.rrd", paths=[str(folder)])
    assert refused.wait() == 3
    assert len(refused.output[1].splitlines()) == 1
