"""The set of one instance of a bank, as the message of a single filter or fusion that any client reads."""

from __future__ import annotations

import math
from typing import Any, cast

from lsu_mesh.mesh.bank_messages import STATUSES, BankFused, BankPosterior, BankSets
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import (
    Bounds,
    Fused,
    Message,
    OrthotopeMessage,
    ParallelotopeMessage,
    Posterior,
    SupportMessage,
)


def posterior_of(configuration: Configuration, message: BankPosterior, i: int) -> Posterior:
    """The posterior of instance i, 0 ≤ i < N; its number and its provenance are those of the bank's message."""
    fields = _common(message, i)
    n = len(fields["lower"])
    support: SupportMessage = OrthotopeMessage(lower=fields["lower"], upper=fields["upper"])
    if message.support == "parallelotope":
        generators = message.matrix("generators")[i].reshape(n, n).tolist()
        support = ParallelotopeMessage(center=message.matrix("center")[i].tolist(), generators=generators)
    volume = float(message.matrix("log_volume")[i, 0])
    return Posterior(
        **fields, kind=message.kind, support=support, log_volume=None if math.isnan(volume) else volume,
        volume_of=message.volume_of, epoch=message.epoch, point_rule=message.point_rule,
        bounds=_bounds(configuration, configuration.filters[message.name].sensors, i),
    )  # fmt: skip


def fused_of(configuration: Configuration, message: BankFused, i: int) -> Fused:
    """The fused set of instance i, 0 ≤ i < N."""
    fields = _common(message, i)
    return Fused(
        **fields, kind="Intersection", support=OrthotopeMessage(lower=fields["lower"], upper=fields["upper"]),
        log_volume=None, volume_of="hull", epoch=0, point_rule="centre", policy=message.policy,
        faults=message.faults, rejected=[], quarantined=[], bounds=_bounds(configuration, (), i),
    )  # fmt: skip


def _common(message: BankSets, i: int) -> dict[str, Any]:
    status = STATUSES[message.statuses[i]]
    return {name: getattr(message, name) for name in Message.__struct_fields__} | {
        "lower": message.matrix("lower")[i].tolist(),
        "upper": message.matrix("upper")[i].tolist(),
        "point": message.matrix("point")[i].tolist(),
        "status": status,
        "guarantee": "none" if status == "inconsistent" else message.guarantee,
        "revision": 0,
        "base": message.base,
        "used": message.used,
        "missing": message.missing,
        "algorithm": message.algorithm,
    }


def _bounds(configuration: Configuration, sensors: tuple[str, ...], i: int) -> Bounds:
    instances = configuration.instances
    rho = configuration.base_model.rho if instances is None or instances.rho is None else instances.rho[i]
    r = [width for name in sensors for width in configuration.sensors[name].r]
    return Bounds(rho=cast("list[float]", rho.tolist()), r=r)
