"""Which mesh a seed simulates: the configuration as it is, or with other transfers, limits, domain or inputs.

The kinds of filters are those of the configuration, whichever they are. Only constrained zonotopes are made small or
replaced where the seed does not take the mesh as it is, and the variant's text says so: a linear program costs more
than all the rest of a step, and the nodes around it are what is tested.
"""

from __future__ import annotations

import functools
import random
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from lsu_mesh.filters.registry import filter_class
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.config.settings import FilterSettings, ScheduledModel, TransferWay
from lsu_mesh.mesh.simulator.external_sensor import with_simulated_plant
from lsu_mesh.mesh.simulator.faults import START_NS
from lsu_mesh.mesh.simulator.time_variants import GRID_TIMES, timed, with_flow
from lsu_mesh.supports.orthotope import Orthotope

RATE = 20.0
"""Steps per second in the simulation: a run of 300 steps spans leases, reconnections and warnings that fade."""
AS_IT_IS = 0.1
"""Share of the runs in which nothing but the rate is changed."""
MAX_GENERATORS, MAX_CONSTRAINTS = 6, 1
"""Limits of constrained zonotopes in the other runs; at least one generator for each state."""
IN_ITS_PLACE = ("LSUO", "LSUPB", "LSUCZ")
"""Guaranteed kinds that a constrained zonotope is drawn from."""
LAGS = (0, 0, 0, 2)
"""Lags of constrained zonotopes that are drawn from."""
WORTH = (0.0, 0.3, 1.1)
"""Nats that make a prediction worth a message."""
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
    times: str = ""
    """How models and sensors go by time, a name of :data:`lsu_mesh.mesh.simulator.time_variants.TIMES`."""
    lag: int = 0
    """Of constrained zonotopes, where it is not that of the configuration; no continuous model goes with it."""
    publish_when: float = 0.0
    """Nats that make a prediction worth a message, for every filter."""

    def __str__(self) -> str:
        words = [f"{name}={kind}" for name, kind in self.kinds]
        words += [f"{self.transfer[0]}.transfer={self.transfer[1]}"] if self.transfer[0] else []
        words += [f"lag={self.lag}"] if self.lag else []
        words += [f"publish_when={self.publish_when:g}"] if self.publish_when else []
        return " ".join([*words, *filter(None, (self.extra, self.times))]) or "as it is"


def draw_variant(rng: random.Random, base: Configuration) -> Variant:
    """The variant of one run."""
    if rng.random() < AS_IT_IS:
        return Variant()
    kinds = tuple((name, _draw_kind(rng, settings.kind)) for name, settings in sorted(base.filters.items()))
    ways: list[TransferWay] = ["off", "off"]
    ways += ["predictor"] if len(base.filters) > 1 else []
    ways += ["fused"] if base.fusion else []
    way = rng.choice(ways)
    transfer: tuple[str, TransferWay] = ("", "off") if way == "off" else (rng.choice(sorted(base.filters)), way)
    return Variant(kinds, transfer, rng.choice(("", "", "", "domain", "input_box")))


def draw_lag(rng: random.Random, base: Configuration, times: str) -> int:
    """The lag of the constrained zonotopes of one run; continuous models refuse one."""
    return rng.choice(LAGS) if times in GRID_TIMES and base.continuous is None else 0


def _draw_kind(rng: random.Random, kind: str) -> str:
    return rng.choice(IN_ITS_PLACE) if kind == "LSUCZ" else kind


@functools.lru_cache(maxsize=512)
def configured(file: Path, steps: int, mesh_seed: int, variant: Variant) -> Configuration:
    """The configuration of a run."""
    base = load(file, (f"mesh.steps={steps}", f"mesh.seed={mesh_seed}"))
    if base.mesh.is_live:
        base = with_simulated_plant(base, START_NS - base.grid.time_of(1) + base.grid.start_ns)
    else:
        base = load(file, (f"mesh.steps={steps}", f"mesh.seed={mesh_seed}", f"mesh.rate={RATE}"))
    if not variant.kinds:
        return base
    small: dict[str, Any] = {
        "max_generators": max(MAX_GENERATORS, base.base_model.state_count),
        "max_constraints": MAX_CONSTRAINTS,
    }
    filters = {name: _of_kind(base.filters[name], kind, _with_lag(base, name, small, variant.lag))
               for name, kind in variant.kinds}  # fmt: skip
    name, way = variant.transfer
    if name:
        # only sets that are guaranteed: an estimate that misses the truth would accuse a true measurement
        sound = [
            other
            for other, settings in filters.items()
            if other != name and filter_class(settings.kind).guarantee == "declared"
        ]
        senders = base.fusion if way == "fused" else sound
        if senders:
            filters[name] = replace(filters[name], transfer=way, transfer_from=tuple(sorted(senders)))
    filters = {name: replace(one, publish_when=variant.publish_when) for name, one in filters.items()}
    fusion = {name: replace(settings, **small) for name, settings in base.fusion.items()}
    return _extended(timed(replace(base, filters=filters, fusion=fusion), variant.times), variant.extra)


def _with_lag(base: Configuration, name: str, small: Mapping[str, Any], lag: int) -> dict[str, Any]:
    """The limits, with room for the earlier states that a constrained zonotope holds too."""
    steps = lag or base.filters[name].lag
    found = {**small, "max_generators": small["max_generators"] + base.base_model.state_count * steps}
    return found | {"lag": steps} if steps else found


def _of_kind(settings: FilterSettings, kind: str, small: Mapping[str, Any]) -> FilterSettings:
    """The filter as it is, with small limits where it is a constrained zonotope, or one of another kind."""
    if kind != settings.kind:
        return replace(settings, kind=kind, options={})
    return replace(settings, options={**settings.options, **small}) if kind == "LSUCZ" else settings


def _extended(configuration: Configuration, extra: str) -> Configuration:
    model = configuration.base_model
    n, p = model.state_count, model.input_count
    if extra == "domain" and model.domain is None:
        box = Orthotope([-DOMAIN] * n, [DOMAIN] * n)
        flow = configuration.continuous
        if flow is None:
            return replace(configuration, base_model=model.replace(domain=box), schedule=_within(configuration, box))
        return with_flow(configuration, flow.replace(domain=box))
    if extra == "input_box" and p and configuration.input_box is None:
        return replace(configuration, input_box=Orthotope([-INPUTS] * p, [INPUTS] * p))
    return configuration


def _within(configuration: Configuration, box: Orthotope) -> tuple[ScheduledModel, ...]:
    return tuple(replace(entry, model=entry.model.replace(domain=box)) for entry in configuration.schedule)
