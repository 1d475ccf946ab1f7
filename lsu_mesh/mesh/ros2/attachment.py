"""What rmw_zenoh attaches to every message: a number that counts per publisher, the time, and who sent it.

The bytes are those of Zenoh's own serialisation: two signed 64-bit integers, little-endian, then the length of the
identifier as LEB128 and its bytes. rmw_zenoh_cpp up to 0.2.3 put the name of each field before it.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

GID_BYTES = 16
_NUMBERS = struct.Struct("<qq")
_NAMES = (b"sequence_number", b"source_timestamp", b"source_gid")
_OLD_START = bytes([len(_NAMES[0])]) + _NAMES[0]


class Attachment(NamedTuple):
    """``sequence`` counts from 1; ``sent_ns``: when it was sent, by the sender's clock; ``gid``: the publisher."""

    sequence: int
    sent_ns: int
    gid: bytes


def encode_attachment(attachment: Attachment) -> bytes:
    """As rmw_zenoh_cpp writes it since 0.2.4."""
    return _NUMBERS.pack(attachment.sequence, attachment.sent_ns) + bytes([len(attachment.gid)]) + attachment.gid


def decode_attachment(data: bytes) -> Attachment | None:
    """An attachment in the form of today, or that with names; None where it is neither."""
    if data.startswith(_OLD_START):
        found = _without_names(data)
        if found is None:
            return None
        data = found
    if len(data) <= _NUMBERS.size:
        return None
    sequence, sent_ns = _NUMBERS.unpack_from(data)
    gid = data[_NUMBERS.size + 1 :]
    if len(gid) != data[_NUMBERS.size]:
        return None
    return Attachment(sequence, sent_ns, gid)


def _without_names(data: bytes) -> bytes | None:
    """The old form as the new one."""
    kept, at = b"", 0
    for name, size in zip(_NAMES, (8, 8, None), strict=True):
        head = bytes([len(name)]) + name
        if not data.startswith(head, at):
            return None
        begin = at + len(head)
        at = len(data) if size is None else begin + size
        kept += data[begin:at]
    return kept
