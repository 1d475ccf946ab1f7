"""``[fusion.NAME]`` and ``[identifier.NAME]``, and what they ask of the filters that they listen to."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import get_args

from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.config.filters import read_names
from lsu_mesh.mesh.config.problem import Problem, Problems
from lsu_mesh.mesh.config.settings import FilterSettings, FusionSettings, IdentifierSettings, Learn, SensorSettings
from lsu_mesh.mesh.config.table import Table

POINT_RULES: tuple[PointRule, ...] = get_args(PointRule)
LEARN: tuple[Learn, ...] = get_args(Learn)


def read_fusion(
    table: Table, name: str, filters: Mapping[str, FilterSettings], peers: Mapping[str, Collection[str]]
) -> FusionSettings:
    """``[fusion.NAME]``; sources are filters and other fusions."""
    known = dict.fromkeys(other for other in (*filters, *peers["fusion"]) if other != name)
    sources = read_names(table, "sources", known)
    policy = table.choice("policy", tuple(POLICIES), "intersect")
    faults = table.whole("faults", 0)
    chosen = POLICIES[policy]
    if faults and not chosen.takes_faults:
        others = " or ".join(f'"{other.name}"' for other in POLICIES.values() if other.takes_faults)
        text = f'is {faults}, but policy = "{policy}" trusts every source; set policy = {others}'
        table.wrong("faults", text, f"0, or policy = {others}")
    elif sources and len(sources) < chosen.sources_needed(faults):
        text = f"is {faults} of {len(sources)} sources; at least one source must be right"
        table.wrong("faults", text, f"a whole number < {len(sources)}")
    max_lag = table.whole("max_lag", 16, low=0, high=4096)
    deadline = table.duration("deadline", 0.05)
    quarantine_after = table.whole("quarantine_after", 20, low=1)
    max_generators = table.whole("max_generators", 30, low=1, high=1000)
    max_constraints = table.whole("max_constraints", 12, low=0, high=500)
    point = table.choice("point", POINT_RULES, "mean")
    table.finish()
    return FusionSettings(
        name=name,
        sources=sources,
        policy=policy,
        faults=faults,
        max_lag=max_lag,
        deadline=deadline,
        quarantine_after=quarantine_after,
        max_generators=max_generators,
        max_constraints=max_constraints,
        point=point,
    )


def read_identifier(table: Table, name: str, sensors: Mapping[str, SensorSettings]) -> IdentifierSettings:
    """``[identifier.NAME]``."""
    chosen = read_names(table, "sensors", sensors)
    learn = table.choice("learn", LEARN, "both")
    window = table.whole("window", 200, low=2, high=100_000)
    every = table.whole("every", 50, low=1)
    margin = table.number("margin", 1.2)
    if margin < 1.0:
        table.mismatch("margin", "at least 1", f"{margin:g}")
    lead = table.whole("lead", 20, low=1)
    table.finish()
    return IdentifierSettings(
        name=name, sensors=chosen, learn=learn, window=window, every=every, margin=margin, lead=lead
    )


def check_learning(
    filters: Mapping[str, FilterSettings],
    fusion: Mapping[str, FusionSettings],
    identifiers: Mapping[str, IdentifierSettings],
    sound: Collection[str],
    problems: Problems,
) -> None:
    """A fusion intersects guaranteed sets only, those of ``sound`` filters, and predicts with the declared rho."""
    for settings in fusion.values():
        for source in settings.sources:
            if source not in filters:
                continue
            one = filters[source]
            if source not in sound:
                text = f'"{source}" is a {one.kind}, whose sets are estimates; a fusion intersects guaranteed sets only'
                problems.add(f"fusion.{settings.name}", "sources", text, expected="filters with guaranteed sets")
            if one.adopt in identifiers and identifiers[one.adopt].learn != "r":
                text = f'its rho may change, the fusion "{settings.name}" would not know; set learn = "r" there'
                problems.add(f"filters.{source}", "adopt", text, expected='an identifier with learn = "r"')
    for one in filters.values():
        lacking = set(one.sensors) - set(identifiers[one.adopt].sensors) if one.adopt in identifiers else set()
        if lacking:
            text = f'"{one.adopt}" does not listen to {", ".join(sorted(lacking))}, whose r the filter needs'
            problems.add(f"filters.{one.name}", "adopt", text, expected="an identifier of all its sensors")


def shared_sensor_warnings(
    file: str, filters: Mapping[str, FilterSettings], fusion: Mapping[str, FusionSettings]
) -> list[Problem]:
    """A sensor that feeds several sources of a relaxed fusion makes that many of them lie at once."""
    return [
        warning
        for settings in fusion.values()
        if POLICIES[settings.policy].takes_faults
        for warning in (*_shared_sensors(file, settings, filters), *_transfers(file, settings, filters))
    ]


def _shared_sensors(file: str, settings: FusionSettings, filters: Mapping[str, FilterSettings]) -> list[Problem]:
    fed: dict[str, list[str]] = {}
    for source in settings.sources:
        for sensor in filters[source].sensors if source in filters else ():
            fed.setdefault(sensor, []).append(source)
    return [
        Problem(
            file=file,
            table=f"fusion.{settings.name}",
            key="faults",
            text=f"is {settings.faults}, but sensor {sensor!r} feeds {len(sources)} sources ({', '.join(sources)}); "
            "if it lies, all of them do",
            expected=f"a whole number ≥ {len(sources)}, or filters with sensors of their own",
            found=str(settings.faults),
            is_warning=True,
        )
        for sensor, sources in sorted(fed.items())
        if len(sources) > settings.faults
    ]


def _transfers(file: str, settings: FusionSettings, filters: Mapping[str, FilterSettings]) -> list[Problem]:
    return [
        Problem(
            file=file,
            table=f"fusion.{settings.name}",
            key="sources",
            text=f'source {source!r} takes transfers, so a liar may reach it; use transfer = "off", or the fused box '
            "of this fusion",
            expected='filters with transfer = "off" or "fused"',
            found=f'"{source}"',
            is_warning=True,
        )
        for source in settings.sources
        if source in filters and filters[source].transfer in ("predictor", "data-predictor")
    ]
