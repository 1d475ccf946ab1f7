"""The row of a bank sums up all of its instances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bank_mesh import posteriors, targets, truths
from local_mesh import LocalMesh
from lsu_mesh_services.monitoring.bank_report import BankReport

from lsu_mesh.mesh.bank_messages import INCONSISTENT
from lsu_mesh.mesh.messages import encode


@pytest.mark.parametrize("is_truth_last", [False, True])
def test_a_row_sums_up_what_was_published(tmp_path: Path, is_truth_last: bool) -> None:
    configuration = targets(tmp_path, "sensors.radar.faults=[{kind='bias',from=30,size=90.0,instances=[2]}]")
    mesh = LocalMesh(configuration)
    mesh.run(5.0)
    report = BankReport(configuration)
    sent = sorted(mesh.sent, key=lambda one: ("bank_truth" in one[0]) == is_truth_last) if is_truth_last else mesh.sent
    for address, message in sent:
        report.deliver(address, encode(message), message.sent_ns + 3_000_000)
    found, x = posteriors(mesh.sent), truths(mesh.sent)
    believed = {k: found[k].status_codes != INCONSISTENT for k in found}
    errors = [(found[k].matrix("point") - x[k].matrix("x"))[believed[k]] for k in found]
    row = report.rows()[0]
    assert (row.name, row.kind, row.steps, row.last_step) == ("targets", "LSUO × 12", 40, 40)
    assert row.inside == 1.0
    assert row.inconsistent == 11
    assert row.rmse == pytest.approx(float(np.sqrt(np.mean(np.square(np.vstack(errors))))))
    assert row.latency_p50_ms == pytest.approx(3.0, abs=0.5)


def test_a_set_that_misses_its_target_is_counted(tmp_path: Path) -> None:
    configuration = targets(tmp_path)
    mesh = LocalMesh(configuration)
    mesh.run(5.0)
    report = BankReport(configuration)
    for address, message in mesh.sent:
        if "bank_truth" in address:
            x = message.matrix("x").copy()  # type: ignore[attr-defined]
            x[5] += 1e3
            message = type(message)(
                **{name: getattr(message, name) for name in message.__struct_fields__} | {"x": x.tobytes()}
            )
        report.deliver(address, encode(message), message.sent_ns)
    assert report.rows()[0].inside == pytest.approx(11 / 12)
