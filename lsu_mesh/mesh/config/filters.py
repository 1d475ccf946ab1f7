"""``[filters.NAME]``: a filter's kind, its sensors, what it takes from others, and the options of its class."""

from __future__ import annotations

import functools
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple, get_args

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.filter import Filter, GainOf
from lsu_mesh.filters.registry import FILTERS, filter_class, filter_kinds
from lsu_mesh.mesh.config.bank import read_instance_count
from lsu_mesh.mesh.config.expected import Expected, Unfit, choice, known_names, nats
from lsu_mesh.mesh.config.filter_options import FilterOptions, try_options
from lsu_mesh.mesh.config.settings import FilterSettings, OnInconsistency, SensorSettings, TransferWay
from lsu_mesh.mesh.config.system import System
from lsu_mesh.mesh.config.table import REQUIRED, Table

TRANSFERS: tuple[TransferWay, ...] = get_args(TransferWay)
INCONSISTENCIES: tuple[OnInconsistency, ...] = get_args(OnInconsistency)
GAINS: tuple[GainOf, ...] = get_args(GainOf)
TRANSFER = "transfer"
ALIASES = {"on_contradiction": "on_inconsistency"}
"""Keys by the names that they had before, which recordings and older files hold."""


class Kind(NamedTuple):
    """The class that ``kind`` names; ``None`` where there is none, which has been noted."""

    name: str
    cls: type[Filter] | None

    @property
    def is_guaranteed(self) -> bool:
        """Whether the sets of the class hold the state while the bounds hold; true where the class is not known."""
        return self.cls is None or self.cls.guarantee == "declared"


def kind_of(table: Table) -> Kind:
    """The key ``kind``: a name of the registry, or ``module:Class``."""
    is_ours = table.values.get("kind") in list(FILTERS)
    words = "a kind of filter" if is_ours else f'{_kinds().words}, or "module:Class"'
    found = table.read("kind", REQUIRED, Expected(words, _as_kind))
    return found if isinstance(found, Kind) else Kind("", None)


@functools.cache
def _kinds() -> Expected[str]:
    """All kinds; those of installed packages are looked for only when a kind is none of ours."""
    return choice(filter_kinds())


def _as_kind(value: Any) -> Kind:
    if not isinstance(value, str) or not value:
        raise Unfit
    try:
        return Kind(value, filter_class(value))
    except ModelError as error:
        if ":" not in value:
            _kinds().convert(value)
        raise Unfit(text=str(error)) from None


def read_filter(
    table: Table,
    name: str,
    kind: Kind,
    sensors: Mapping[str, SensorSettings],
    system: System,
    peers: Mapping[str, Collection[str]],
) -> FilterSettings:
    """``[filters.NAME]``; the filter is made once, so that the class checks its own options (``makes_filters``).

    ``peers`` holds the names of all ``filters`` and ``fusion`` tables.
    """
    chosen = read_names(table, "sensors", sensors)
    deadline = table.duration("deadline", 0.05)
    history = table.whole("history", 32, low=1, high=4096)
    transfer = _read_transfer(table)
    senders = _read_senders(table, name, transfer.way, peers)
    on_inconsistency = _read_inconsistency(table)
    reset_after = table.whole("reset_after", 5, low=1)
    adopt = _read_adopt(table, peers["identifier"], system)
    instances = read_instance_count(table)
    if instances and "history" in table.values:
        table.without("history", "has no effect: a bank does not do steps again", "remove it")
    options = _read_options(table, kind, sensors, chosen=chosen, system=system)
    return FilterSettings(
        name=name,
        kind=kind.name,
        sensors=chosen,
        deadline=deadline,
        history=history,
        transfer=transfer.way,
        transfer_from=senders,
        transfer_gain=transfer.gain,
        publish_when=transfer.publish_when,
        on_inconsistency=on_inconsistency,
        reset_after=reset_after,
        options=options,
        adopt=adopt,
        instances=instances,
    )


class TransferKeys(NamedTuple):
    """``transfer``: what is taken, whose volumes its gain compares, and when the own prediction is published."""

    way: TransferWay
    gain: GainOf
    publish_when: float


def _read_transfer(table: Table) -> TransferKeys:
    """``transfer``: a word, or a table with the word as ``way``."""
    word: TransferWay = "off"
    if isinstance(table.values.get(TRANSFER), dict):
        inner = table.table(TRANSFER)
        assert inner is not None
    else:
        word = table.choice(TRANSFER, TRANSFERS, word)
        inner = Table({}, f"{table.path}.{TRANSFER}", table.problems)
    way = inner.choice("way", TRANSFERS, word)
    gain = inner.choice("gain", GAINS, "hull")
    publish_when = inner.read("publish_when", 0.0, nats())
    inner.finish()
    if gain != "hull" and way == "off":
        inner.without("gain", 'has no effect with way = "off"', "remove it or choose a way")
    return TransferKeys(way, gain, publish_when)


def _read_inconsistency(table: Table) -> OnInconsistency:
    """``on_inconsistency``, or its old name."""
    found = table.choice("on_inconsistency", INCONSISTENCIES, "reset")
    (old,) = ALIASES
    if old not in table.values:
        return found
    if "on_inconsistency" in table.values:
        table.without(old, "is the old name of on_inconsistency, which is given too", "remove one of the two")
    named: OnInconsistency = table.read(old, found, choice(INCONSISTENCIES), is_alias=True)
    return named


def _read_adopt(table: Table, identifiers: Collection[str], system: System) -> str:
    """``adopt``: adoption starts again from the domain, so there must be one."""
    adopt = table.text("adopt", None)
    if adopt is None:
        return ""
    if adopt not in identifiers:
        _note_unknown(table, "adopt", adopt, known_names(identifiers, "there is no identifier {name}"))
    elif system.model is not None and system.model.domain is None:
        text = "adopting bounds starts again from the domain; give [model.domain]"
        table.wrong("adopt", text, "a model with [model.domain]")
    return str(adopt)


def _note_unknown(table: Table, key: str, name: str, known: Expected[str]) -> bool:
    """Note that a name is not known here; whether it was."""
    try:
        known.convert(name)
    except Unfit as unfit:
        table.wrong(key, unfit.text, known.words, near=unfit.nearest)
        return False
    return True


def _read_senders(
    table: Table, name: str, transfer: TransferWay, peers: Mapping[str, Collection[str]]
) -> tuple[str, ...]:
    """``transfer_from``: by default all other filters, or for fused boxes all fusions."""
    known = peers["fusion"] if transfer == "fused" else [other for other in peers["filters"] if other != name]
    given = table.texts("transfer_from", None)
    if transfer == "off":
        if given:
            table.without("transfer_from", 'has no effect with transfer = "off"', "remove it or choose a transfer")
        return ()
    for other in given or ():
        _note_unknown(table, "transfer_from", other, known_names(known, "{name} cannot be transferred from"))
    senders = tuple(sorted(set(known if given is None else given)))
    if not senders:
        what = "a fusion" if transfer == "fused" else "another filter with guaranteed sets"
        text = f'"{transfer}" has no source; give {what}, or set "off"'
        table.wrong("transfer", text, f'"off", or {what} in the file')
    return senders


def _read_options(
    table: Table, kind: Kind, sensors: Mapping[str, SensorSettings], chosen: tuple[str, ...], system: System
) -> dict[str, Any]:
    """The options of the class; its constructor checks them too, if it is asked and all that it needs is there."""
    if kind.cls is None:
        return table.rest()
    cls = kind.cls
    own = FilterOptions(cls)
    options = own.read(table)
    if not table.problems.makes_filters:
        return options
    noted = table.problems.are_in
    has_sensors = chosen and not noted(table.path, "sensors") and not any(noted(f"sensors.{name}") for name in chosen)
    has_boxes = not noted("model.prior") and not noted("model.domain")
    if system.model is None or system.prior is None or not has_boxes or not has_sensors:
        return options
    rows = [row for name in chosen for row in sensors[name].C]
    widths = [width for name in chosen for width in sensors[name].r]
    model, prior = system.model.replace(C=rows, r=widths), system.prior
    fine = {key: value for key, value in options.items() if not noted(table.path, key)}
    missing = any(noted(table.path, name) for name in own.names if name not in table.values)
    if not missing:
        try_options(table, lambda chosen: cls(model, prior, **chosen), fine, own.required)  # type: ignore[call-arg]
    return options


def read_names(table: Table, key: str, known: Mapping[str, object]) -> tuple[str, ...]:
    """A list of names that are defined elsewhere in the file, in their order; each once."""
    names = table.texts(key)
    if not isinstance(names, list):
        return ()
    names_known = known_names(known, "{name} is not defined")
    if not names:
        table.wrong(key, "is empty; name at least one", names_known.words)
    for name in dict.fromkeys(names):
        if _note_unknown(table, key, name, names_known) and names.count(name) > 1:
            table.wrong(key, f'"{name}" is named twice', "each name once")
    return tuple(sorted({name for name in names if name in known}))
