"""Which mesh a seed simulates: the configuration as it is, or with other filters, transfers, limits, domain or inputs.

Where the seed does not take the mesh as it is, constrained zonotopes are small or replaced: a linear program costs more
than all the rest of a step, and the nodes around it are what is tested.
"""

from __future__ import annotations

import functools
import random
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.config.settings import FilterSettings, TransferWay
from lsu_mesh.supports.orthotope import Orthotope

RATE = 20.0
"""Steps per second in the simulation: a run of 300 steps spans leases, reconnections and warnings that fade."""
AS_IT_IS = 0.1
"""Share of the runs in which nothing but the rate is changed."""
MAX_GENERATORS, MAX_CONSTRAINTS = 6, 1
"""Limits of constrained zonotopes in the other runs."""
KINDS: Mapping[str, Mapping[str, Any]] = {
    "LSUO": {},
    "LSUP": {},
    "LSUPB": {},
    "LSUCZ": {"max_generators": MAX_GENERATORS, "max_constraints": MAX_CONSTRAINTS},
}
DOMAIN, INPUTS = 50.0, 6.0
"""Half-widths of a domain and of an input box that are true."""


class Variant(NamedTuple):
    """What is changed."""

    kinds: tuple[tuple[str, str], ...] = ()
    """Filters and their kinds; empty: the mesh as it is."""
    transfer: tuple[str, TransferWay] = ("", "off")
    """A filter and the way in which it takes transfers."""
    extra: str = ""
    """``domain`` or ``input_box``."""

    def __str__(self) -> str:
        words = [f"{name}={kind}" for name, kind in self.kinds]
        words += [f"{self.transfer[0]}.transfer={self.transfer[1]}"] if self.transfer[0] else []
        return " ".join([*words, self.extra]).strip() or "as it is"


def draw_variant(rng: random.Random, base: Configuration) -> Variant:
    """The variant of one run."""
    if rng.random() < AS_IT_IS:
        return Variant()
    kinds = tuple((name, _draw_kind(rng, settings.kind)) for name, settings in sorted(base.filters.items()))
    ways: list[TransferWay] = ["off", "off"]
    if len(base.filters) > 1:
        ways.append("predictor")
    if base.fusion:
        ways.append("fused")
    way = rng.choice(ways)
    transfer: tuple[str, TransferWay] = ("", "off") if way == "off" else (rng.choice(sorted(base.filters)), way)
    return Variant(kinds, transfer, rng.choice(("", "", "", "domain", "input_box")))


def _draw_kind(rng: random.Random, kind: str) -> str:
    if kind == "LSUCZ":
        return rng.choice(("LSUO", "LSUPB", "LSUCZ"))
    return kind if kind in KINDS else "LSUO"


@functools.lru_cache(maxsize=512)
def configured(file: Path, steps: int, mesh_seed: int, variant: Variant) -> Configuration:
    """The configuration of a run."""
    base = load(file, (f"mesh.steps={steps}", f"mesh.seed={mesh_seed}", f"mesh.rate={RATE}"))
    if not variant.kinds:
        return base
    filters = {name: _of_kind(base.filters[name], kind) for name, kind in variant.kinds}
    name, way = variant.transfer
    if name:
        senders = base.fusion if way == "fused" else [other for other in filters if other != name]
        filters[name] = replace(filters[name], transfer=way, transfer_from=tuple(sorted(senders)))
    fusion = {
        name: replace(settings, max_generators=MAX_GENERATORS, max_constraints=MAX_CONSTRAINTS)
        for name, settings in base.fusion.items()
    }
    return _extended(replace(base, filters=filters, fusion=fusion), variant.extra)


def _of_kind(settings: FilterSettings, kind: str) -> FilterSettings:
    """A filter of another kind, or small where it is a constrained zonotope."""
    if kind == settings.kind != "LSUCZ":
        return settings
    return replace(settings, kind=kind, options=KINDS[kind])


def _extended(configuration: Configuration, extra: str) -> Configuration:
    model = configuration.base_model
    n, p = model.state_count, model.input_count
    if extra == "domain" and model.domain is None:
        box = Orthotope([-DOMAIN] * n, [DOMAIN] * n)
        return replace(configuration, base_model=model.replace(domain=box))
    if extra == "input_box" and p and configuration.input_box is None:
        return replace(configuration, input_box=Orthotope([-INPUTS] * p, [INPUTS] * p))
    return configuration
