"""Fields that a newer peer has added to a message: they are taken off, named, and never believed.

Only payloads that strict decoding has refused come here, so messages of this version pay nothing. Values of unknown
fields are skipped and not built: however large they are, they cost no memory.
"""

from __future__ import annotations

import functools
import operator
import types
from collections.abc import Sequence
from typing import Any, NamedTuple

import msgspec
from msgspec import Raw, Struct, inspect

MAX_UNKNOWN = 256
"""Most unknown fields of one message."""
MAX_NAME = 64
"""Characters of a name that are told."""

_MAP = msgspec.msgpack.Decoder(dict[str, Raw])
_LIST = msgspec.msgpack.Decoder(list[Raw])
_TEXT = msgspec.msgpack.Decoder(str)
_ENCODER = msgspec.msgpack.Encoder()

Part = bytes | Raw


class _Heads(NamedTuple):
    """First bytes of a map or list: from ``short`` on with its size in it, ``long`` and the next before its size."""

    short: int
    long: int


_MAPS, _LISTS = _Heads(0x80, 0xDE), _Heads(0x90, 0xDC)


class TooManyFields(ValueError):
    """A message has more unknown fields than anyone will ever add."""


class _Shape:
    """The maps that may stand at one place of a message, and what stands in their fields.

    ``fields`` are by tag, ``""`` where the map has none; ``within`` are the fields that hold further maps.
    """

    def __init__(self, structs: Sequence[inspect.StructType]) -> None:
        self.tag_field = structs[0].tag_field
        tagged = {str(struct.tag or ""): struct.fields for struct in structs}
        self.fields = {tag: frozenset(field.encode_name for field in fields) for tag, fields in tagged.items()}
        self.within = {
            tag: {field.encode_name: found for field in fields if (found := _place(field.type)) is not None}
            for tag, fields in tagged.items()
        }


class _Place(NamedTuple):
    """A field that holds maps, in lists of at most so many entries, in one another.

    ``strict`` are decoders of what stands there, in all of the lists and then in one fewer each: most maps of a newer
    message have nothing new, and are through at once.
    """

    shape: _Shape
    strict: tuple[msgspec.msgpack.Decoder[Any], ...]
    lists: tuple[int, ...] = ()

    def is_known(self, part: Part) -> bool:
        """Whether there is nothing unknown in it, because strict decoding takes it."""
        try:
            self.strict[0].decode(part)
        except msgspec.ValidationError:
            return False
        return True

    def entry(self) -> _Place:
        """What stands in a list of these."""
        return self._replace(strict=self.strict[1:], lists=self.lists[1:])


def without_unknown(payload: bytes, kind: type[Struct]) -> tuple[bytes, tuple[str, ...]]:
    """The payload without the fields that ``kind`` and the maps inside it do not have, and their names.

    A name inside a map says where: ``support.colour``. A map whose ``type`` is unknown stays as it is.

    Raises
    ------
    TooManyFields
        There are more than ``MAX_UNKNOWN`` unknown fields.
    msgspec.DecodeError, RecursionError, UnicodeDecodeError
        It is not MessagePack, or the name of a field is no string.
    """
    reading = _Reading()
    known = reading.known(payload, _place_of(kind), "")
    return bytes(known), tuple(reading.unknown)


@functools.cache
def _place_of(kind: type[Struct]) -> _Place:
    place = _place(inspect.type_info(kind))
    assert place is not None
    return place


def _place(described: inspect.Type) -> _Place | None:
    """What maps a field holds; ``None`` where it holds none."""
    if isinstance(described, inspect.ListType):
        entry, longest = _place(described.item_type), described.max_length
        if entry is None:
            return None
        assert longest is not None, "lists of maps have a limit"
        listed: Any = types.GenericAlias(list, (entry.strict[0].type,))
        return _Place(entry.shape, (msgspec.msgpack.Decoder(listed), *entry.strict), (longest, *entry.lists))
    kinds = described.types if isinstance(described, inspect.UnionType) else (described,)
    structs = [one for one in kinds if isinstance(one, inspect.StructType)]
    if not structs:
        return None
    union: Any = functools.reduce(operator.or_, (struct.cls for struct in structs))
    return _Place(_Shape(structs), (msgspec.msgpack.Decoder(union),))


class _Reading:
    """One payload: what of it is known, and the names of the rest."""

    def __init__(self) -> None:
        self.unknown: dict[str, None] = {}
        """Names, each once, in their order."""
        self._surplus = 0
        """By how many fields its maps are larger than what is known of them."""

    def known(self, part: Part, place: _Place, path: str) -> Part:
        """What stands at a place, without what is unknown; what has no such form stays, and is refused later."""
        size = _size(part, _LISTS if place.lists else _MAPS)
        if size is None:
            return part
        if not place.lists:
            return self._known_map(part, size, place.shape, path)
        if size > place.lists[0]:
            return part
        entry = place.entry()
        return _ENCODER.encode([self._known_within(item, entry, path) for item in _LIST.decode(part)])

    def _known_within(self, part: Raw, place: _Place, path: str) -> Raw:
        return part if place.is_known(part) else Raw(self.known(part, place, path))

    def _known_map(self, part: Part, size: int, shape: _Shape, path: str) -> Part:
        self._surplus += max(0, size - max(map(len, shape.fields.values())) - 1)
        if self._surplus > MAX_UNKNOWN:
            raise TooManyFields(f"more than {MAX_UNKNOWN} unknown fields")
        content = _MAP.decode(part)
        tag = "" if shape.tag_field is None else _text(content.get(shape.tag_field))
        if tag is None or tag not in shape.fields:
            return part
        names, within, known = shape.fields[tag], shape.within[tag], dict[str, Raw]()
        for name, value in content.items():
            if name in within:
                known[name] = self._known_within(value, within[name], f"{path}{name}.")
            elif name in names or name == shape.tag_field:
                known[name] = value
            else:
                self.unknown[_readable(f"{path}{name}")] = None
        return _ENCODER.encode(known)


def _size(part: Part, heads: _Heads) -> int | None:
    """How many entries a map or list says that it has; ``None`` where ``part`` is none."""
    view = memoryview(part)
    if not len(view):
        return None
    first = view[0]
    if heads.short <= first < heads.short + 16:
        return first - heads.short
    width = 2 if first == heads.long else 4 if first == heads.long + 1 else 0
    return int.from_bytes(view[1 : 1 + width], "big") if width else None


def _text(part: Part | None) -> str | None:
    try:
        return None if part is None else _TEXT.decode(part)
    except msgspec.ValidationError:
        return None


def _readable(name: str) -> str:
    """A name that a stranger chose, fit for a counter and a terminal."""
    return "".join(letter if letter.isprintable() else "?" for letter in name[:MAX_NAME])
