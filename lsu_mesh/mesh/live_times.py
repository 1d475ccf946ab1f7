"""Whether the time of a live datum can be true, as the receiver's clock sees it. Admission asks here.

A sensor whose clock is an hour ahead would move everybody to steps that are not there yet, and one whose clock is
behind would tell of moments at which it did not measure. Neither may reach a set.

The clock judges only what comes when it is sent. What a clock that was ten seconds ahead has stamped looks true ten
seconds later; so nobody takes live data from caches, and a process that stood still takes none that waited for it.
"""

from __future__ import annotations

from lsu_mesh.mesh.bank_messages import BankMeasurement
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Input, Measurement, Message, Refused

SECOND = 1_000_000_000


def ahead_ns(configuration: Configuration, message: Measurement | BankMeasurement | Input, now: int) -> int | None:
    """How far the time of a live datum lies ahead of ``now`` (negative: behind); None for what is not live."""
    if isinstance(message, Measurement | BankMeasurement):
        sensor = configuration.sensors[message.name]
        if not sensor.is_live or (message.time_error_ns is None and message.step < 1):
            return None
        own = message.time_error_ns is not None
        return (message.time_ns if own else configuration.grid.time_of(message.step)) - now
    if configuration.plant is None or not configuration.plant.is_external:
        return None
    return (configuration.grid.time_of(message.step) if message.time_ns is None else message.time_ns) - now


def check_live_time(
    configuration: Configuration, message: Measurement | BankMeasurement | Input, now: int, *, has_waited: bool = False
) -> None:
    """Refuse a live datum from the future, from too long ago, or one that ``has_waited`` for the receiver.

    Raises
    ------
    Refused
        ``future``: its earliest moment lies more than ``[mesh] future`` ahead of the receiver's clock. ``past``: its
        latest moment lies more than ``[mesh] past`` behind it. ``waited``: nobody knows how long ago it came.
    """
    ahead = ahead_ns(configuration, message, now)
    if ahead is None:
        return
    if has_waited:
        raise Refused("waited", f"{message.name} sent it while this process stood still; its time cannot be judged")
    error = (message.time_error_ns or 0) if isinstance(message, Measurement | BankMeasurement) else 0
    mesh = configuration.mesh
    if ahead - error > mesh.future_ns:
        text = (
            f"{message.name} says a time {ahead / SECOND:.3g} s ahead of this clock, and at most "
            f"{mesh.future_ns / SECOND:g} s are believed; set one of the two clocks, or [mesh] future"
        )
        raise Refused("future", text, source=message.name, seconds=-ahead / SECOND)
    if ahead + error < -mesh.past_ns:
        text = (
            f"{message.name} says a time {-ahead / SECOND:.3g} s behind this clock, and at most "
            f"{mesh.past_ns / SECOND:g} s are believed; set one of the two clocks, or [mesh] past where data come late"
        )
        raise Refused("past", text, source=message.name, seconds=-ahead / SECOND)


def can_be_true(configuration: Configuration, message: Message, now: int) -> bool:
    """Whether nobody refuses a message for its time, as :func:`check_live_time` does, where it comes at ``now``."""
    if not isinstance(message, Measurement | BankMeasurement | Input):
        return True
    try:
        check_live_time(configuration, message, now)
    except Refused:
        return False
    return True
