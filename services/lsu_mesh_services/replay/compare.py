"""One configuration that has the recorded filters and the new ones, told apart by their names."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from lsu_mesh.mesh.config import Configuration, load_values

SUFFIX = "-new"
"""What stands behind the names of new filters and fusions."""
Values = dict[str, Any]


class CannotReplay(Exception):
    """The other mesh cannot run on the recorded data; the text says why."""


def beside(recorded: Configuration, other: Configuration) -> tuple[Configuration, Configuration]:
    """The other mesh's filters and fusions under new names, fed by the recorded sensors; and both meshes as one.

    Raises :class:`CannotReplay` where the recording lacks what the other mesh needs.
    """
    _check_data(recorded, other)
    old = copy.deepcopy(dict(recorded.values))
    new = _renamed(copy.deepcopy(dict(other.values)))
    new |= {"mesh": old["mesh"]}
    new.pop("plant", None)
    if "plant" in old:
        new["plant"] = old["plant"]
    joined = copy.deepcopy(old)
    for kind in ("filters", "fusion"):
        joined[kind] = {**old.get(kind, {}), **new.get(kind, {})}
    return load_values(new, other.path, reads_files=False), load_values(joined, recorded.path, reads_files=False)


def _renamed(values: Values) -> Values:
    """All filters and fusions with the suffix, also where others name them."""
    known = {*values.get("filters", {}), *values.get("fusion", {})}
    for kind in ("filters", "fusion"):
        tables: Mapping[str, Values] = values.get(kind, {})
        for table in tables.values():
            for key in ("sources", "transfer_from"):
                if key in table:
                    table[key] = [f"{name}{SUFFIX}" if name in known else name for name in table[key]]
        if tables:
            values[kind] = {f"{name}{SUFFIX}": table for name, table in tables.items()}
    return values


def _check_data(recorded: Configuration, other: Configuration) -> None:
    needed = {sensor for settings in other.filters.values() for sensor in settings.sensors}
    for name in sorted(needed):
        if name not in recorded.sensors:
            known = ", ".join(recorded.sensors)
            raise CannotReplay(f"{other.path}: sensor {name!r} is not in the recording; it has {known}")
        found, expected = len(recorded.sensors[name].C), len(other.sensors[name].C)
        if found != expected:
            raise CannotReplay(f"{other.path}: sensor {name!r} has {expected} outputs, the recorded one has {found}")
    found, expected = recorded.base_model.input_count, other.base_model.input_count
    if expected not in (0, found):
        raise CannotReplay(f"{other.path}: the model has {expected} inputs, the recorded one has {found}")
    if recorded.base_model.state_count != other.base_model.state_count:
        found, expected = recorded.base_model.state_count, other.base_model.state_count
        raise CannotReplay(f"{other.path}: the model has {expected} states, the recorded one has {found}")
