"""Banks as real processes: a plant, a sensor and a bank; and a program that measures all targets itself."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from bank_mesh import TEXT, write
from lsu_mesh_services.client import STATUSES, BankEstimate, Mesh, Stream, WrongValue, connect
from ports import free_port
from waiting import WITHIN

from lsu_mesh.mesh.messages import Posterior, decode

pytestmark = pytest.mark.live

Start = Callable[..., Any]
FORGOTTEN = 70
"""Steps of .1 s: publishers keep those of six seconds."""


def mesh_file(folder: Path, text: str = TEXT) -> Path:
    """The mesh of banks on a free port."""
    return write(folder, f'{text}\n[network]\nentry = "tcp/127.0.0.1:{free_port()}"\n')


def received(estimates: Stream[BankEstimate], count: int) -> list[BankEstimate]:
    """So many estimates."""
    found: list[BankEstimate] = []
    end = time.monotonic() + 2 * WITHIN
    while len(found) < count:
        assert time.monotonic() < end, f"{len(found)} of {count} estimates"
        one = estimates.next(0.5)
        found += [] if one is None else [one]
    return found


def latest(mesh: Mesh, target: int) -> Posterior:
    """The answer about one target, as the protocol describes a posterior."""
    found = mesh.latest("targets", target=target)
    assert found is not None
    message = decode("posterior", msgpack.packb(dict(found.raw)))
    assert isinstance(message, Posterior)
    return message


def test_a_client_reads_all_targets_and_asks_for_one(start: Start, tmp_path: Path) -> None:
    file = mesh_file(tmp_path, TEXT.replace("steps = 40", "steps = 100000"))
    start("run", str(file), "--no-record")
    with connect(file, wait=2 * WITHIN) as mesh:
        estimates = mesh.bank("targets")
        found = received(estimates, 5)
        assert [one.step for one in found] == list(range(found[0].step, found[0].step + 5))
        last = found[-1].numpy()
        assert last.lower.shape == (12, 4)
        assert (last.lower <= last.upper).all()
        assert last.lower[7, 2] == found[-1].lower[7, 2]
        assert last.status(7) == "ok"
        one = latest(mesh, 7)
        same = next(two for two in received(estimates, 10) if two.step >= one.step)
        if same.step == one.step:
            assert same.numpy().lower[7].tolist() == one.lower
        assert one.src == "filter/targets"
        with pytest.raises(WrongValue, match="targets has instances 0 to 11, not 12"):
            mesh.latest("targets", target=12)
        assert mesh.latest("targets", 0.2) is None, "a bank has no posterior of a single filter"


def test_a_program_measures_all_targets(start: Start, tmp_path: Path) -> None:
    text = TEXT.replace("steps = 40", 'start_time = "now"').replace(
        "[sensors.lidar]\nC = [[1.0, 0.0, 1.0, 0.0]]\nr = [0.2]", ""
    )
    text = text.replace('sensors = ["radar", "lidar"]', 'sensors = ["radar"]')
    text = text.replace("r = [0.5, 0.5]", 'r = [0.5, 0.5]\nsource = "external"\ngrid_tolerance = "60ms"')
    file = mesh_file(tmp_path, text)
    start("run", str(file), "--no-record")
    truth = np.random.default_rng(1).uniform(-3.0, 3.0, (12, 2))
    with connect(file, wait=2 * WITHIN) as mesh:
        radar, estimates = mesh.sensor("radar"), mesh.bank("targets")
        with pytest.raises(WrongValue, match="a row per target"):
            radar.publish_all(truth[:5])
        with pytest.raises(WrongValue, match="expected 12, one per target"):
            radar.publish_all(truth[:5].tolist())
        with pytest.raises(WrongValue, match="publish_all"):
            radar.publish([1.0, 2.0])
        found: list[BankEstimate] = []
        end = time.monotonic() + 2 * WITHIN
        while len(found) < 10:
            assert time.monotonic() < end, f"{len(found)} estimates"
            rows: Any = truth + 0.3
            rows[3] = np.nan
            listed = [[None if np.isnan(value) else value for value in row] for row in rows.tolist()]
            radar.publish_all(rows if len(found) % 2 else listed)
            one = estimates.next(0.1)
            found += [] if one is None else [one]
    for one in found:
        seen = np.delete(np.arange(12), 3)
        estimate = one.numpy()
        assert (estimate.lower[:, [0, 2]][seen] <= truth[seen]).all()
        assert (truth[seen] <= estimate.upper[:, [0, 2]][seen]).all()
        assert one.status(3) in ("predicted", "restarted")


def test_a_bank_that_was_killed_takes_up_what_the_fusion_kept(start: Start, tmp_path: Path) -> None:
    text = TEXT.replace("steps = 40", "steps = 100000") + '\n[fusion.main]\nsources = ["targets"]\n'
    file = mesh_file(tmp_path, text)
    session = start("run", str(file), "--no-record")
    with connect(file, wait=2 * WITHIN) as mesh:
        estimates, fused = mesh.bank("targets"), mesh.bank("main")
        before = received(estimates, 5)[-1]
        while before.step <= FORGOTTEN:  # no cache holds the first steps: no way from the prior
            before = received(estimates, 1)[-1]
        received(fused, 5)
        one = mesh.latest("main", target=3)
        assert one is not None
        assert one.raw["policy"] == "intersect"
        session.child("filter targets").kill()
        end = time.monotonic() + 2 * WITHIN
        while (again := received(estimates, 1)[0]).raw["boot"] == before.raw["boot"]:
            assert time.monotonic() < end, "it did not start again"
        again = min([again, *received(estimates, 5)], key=lambda one: int(one.raw["seq"]))  # a cache may answer later
        assert again.raw["seq"] == 0
        assert set(again.statuses) == {STATUSES.index("restarted")}
        assert again.raw["base"][:3] == ["bank_posterior", "filter/targets", before.raw["boot"]]
        assert received(estimates, 3)[-1].status(3) == "ok"
