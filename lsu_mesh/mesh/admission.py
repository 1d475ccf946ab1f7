"""Admission to a node: only sound, known and new messages are let in, everything else is counted by reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection

from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.mesh.bank_messages import BankMeasurement, BankMessage, BankSets, BankTruth, read_any
from lsu_mesh.mesh.config.settings import CACHED_SECONDS, Configuration
from lsu_mesh.mesh.duplicate_publishers import DuplicatePublishers
from lsu_mesh.mesh.input_time import check_beginning
from lsu_mesh.mesh.keys import parse
from lsu_mesh.mesh.live_times import check_live_time
from lsu_mesh.mesh.measurement_time import is_timed, placed
from lsu_mesh.mesh.messages import (
    ConstrainedZonotopeMessage,
    Fused,
    Input,
    IntersectionMessage,
    Measurement,
    Message,
    OrthotopeMessage,
    Posterior,
    Prediction,
    Refused,
    Smoothed,
    Suggestion,
    SupportMessage,
    Truth,
)
from lsu_mesh.mesh.sequences import Sequence

ROLE_OF_TOPIC = {
    "truth": "plant",
    "input": "plant",
    "measurement": "sensor",
    "prediction": "filter",
    "posterior": "filter",
    "smoothed": "filter",
    "fused": "fusion",
    "bounds": "identifier",
    "bank_truth": "plant",
    "bank_measurement": "sensor",
    "bank_posterior": "filter",
    "bank_fused": "fusion",
}
MAX_BOOTS = 16
UNLIMITED = 4096
DUPLICATE_PUBLISHER = "duplicate publisher"
MAX_NAMES = 64
"""So many unknown fields are counted by name; whoever sends more of them is counted without."""


class Admission:
    """Decodes payloads and lets through what this mesh's configuration says may come.

    A measurement with a time of its own gets the step of that time, 0 where it lies before the first step.

    ``counters`` holds ``received``, ``duplicates``, ``gaps`` and ``refused.<reason>``; where a newer peer sends fields
    that are unknown here, also ``unknown fields``, the messages that had some, and ``unknown fields.<topic>.<field>``.
    """

    def __init__(self, configuration: Configuration, topics: Collection[str]) -> None:
        self._configuration = configuration
        self._mesh = configuration.mesh.name
        self._digest = configuration.digest()
        self._topics = frozenset(topics)
        self._states = configuration.base_model.state_count
        self._inputs = configuration.base_model.input_count
        self._last = configuration.mesh.steps
        self._most_generators = most_generators(configuration)
        self._noises = configuration.base_model.rho.size
        self._rows = {name: len(sensor.C) for name, sensor in configuration.sensors.items()}
        self._names = {
            "plant": frozenset({configuration.plant.name} if configuration.plant else ()),
            "sensor": frozenset(configuration.sensors),
            "filter": frozenset(configuration.filters),
            "fusion": frozenset(configuration.fusion),
            "recorder": frozenset({"recorder"}),
            "identifier": frozenset(configuration.identifiers),
        }
        self._sequences: dict[tuple[str, str], Sequence] = {}
        self.received = 0
        self.duplicates = 0
        self.refused: Counter[str] = Counter()
        self.last_refusal = self.last_reason = ""
        self.with_unknown_fields = 0
        """Messages let in without fields that are unknown here."""
        self.unknown_fields: Counter[str] = Counter()
        """By topic and field, such as ``posterior.support.colour``."""
        self.stood_still = False
        """Whether what comes now has waited while this process stood still."""
        self.decoder: Callable[[str, bytes], tuple[Message, tuple[str, ...]]] = read_any
        """What makes messages of payloads; many receivers in one process may share one with a memory."""
        self.publishers: DuplicatePublishers | None = None
        """Which of two living processes of one key is refused; None: what all of them send is let in."""
        self.datum_refused: Callable[[Refused, int], None] | None = None
        """Told of each datum that is refused for its time, and when that was."""
        self.wanted_again: Callable[[str, str, Collection[int]], None] | None = None
        """Told of the numbers of a key and boot that were refused and are asked for now."""
        self._gaps_of_forgotten = 0

    def admit(self, key: str, payload: bytes, now: int | None = None) -> Message | None:
        """The message, or ``None`` when it is refused or a copy.

        ``now``: the receiver's clock in ns since 1970 when it came, by which times of live sources are judged, and
        whether another process lives; None: they are not.
        """
        try:
            message, unknown = self._checked(key, payload, now)
            if not self._is_new(key, message):
                self.duplicates += 1
                return None
            self._check_publisher(key, message, now)
        except Refused as refusal:
            self._refuse(key, refusal, now)
            return None
        self.received += 1
        if unknown:
            self._count_unknown(message.topic, unknown)
        return message

    @property
    def gaps(self) -> int:
        """Messages that exist and have not come, whether they are still asked for or are given up."""
        return self._gaps_of_forgotten + sum(sequence.gaps for sequence in self._sequences.values())

    def expect(self, key: str, boot: str, first: int, last: int) -> None:
        """The messages with these numbers exist and have not been admitted: whoever waited for them gives them up."""
        identity = (key, boot)
        if identity not in self._sequences:
            self._forget_old_boots(key)
            self._sequences[identity] = Sequence(first)
        self._sequences[identity].expect(first, last)

    def is_cached(self, key: str) -> bool:
        """Whether the publisher of a key keeps what it sent; that of live data is asked for nothing."""
        address = parse(key)
        return address is not None and not self._configuration.is_live(address.topic, address.name)

    @property
    def kept_ns(self) -> int | None:
        """For how long publishers keep what they sent, at least; None in a mesh without a rate."""
        rate = self._configuration.mesh.rate
        return None if rate <= 0 else int(max(CACHED_SECONDS, self._configuration.cached / rate) * 1e9)

    def gaps_by_key(self) -> dict[str, int]:
        """The same by key, without the keys that lack nothing, and without live ones: those are asked of no cache."""
        gaps: Counter[str] = Counter()
        for (key, _), sequence in self._sequences.items():
            if sequence.gaps and self.is_cached(key):
                gaps[key] += sequence.gaps
        return dict(gaps)

    @property
    def counters(self) -> dict[str, float]:
        """All counts, for the health message."""
        counts: dict[str, float] = {
            "received": self.received,
            "duplicates": self.duplicates,
            "gaps": self.gaps,
        }
        counts |= {f"refused.{reason}": count for reason, count in sorted(self.refused.items())}
        if self.with_unknown_fields:
            counts["unknown fields"] = self.with_unknown_fields
            counts |= {f"unknown fields.{name}": count for name, count in sorted(self.unknown_fields.items())}
        return counts

    def _refuse(self, key: str, refusal: Refused, now: int | None) -> None:
        self.refused[refusal.reason] += 1
        self.last_refusal, self.last_reason = f"{key}: {refusal.reason}: {refusal}"[:300], refusal.reason
        if refusal.seconds is not None and now is not None and self.datum_refused is not None:
            self.datum_refused(refusal, now)

    def _check_publisher(self, key: str, message: Message, now: int | None) -> None:
        """Refuse what a second living process sends; what was refused when the first was gone already is asked for."""
        if self.publishers is None or now is None:
            return
        pair = self.publishers.refuses(key, message, now)
        for address, boot, numbers in self.publishers.take_missed():
            if not self._configuration.is_live(message.topic, message.name):
                self._sequences[address, boot].want(numbers)
                if self.wanted_again is not None:
                    self.wanted_again(address, boot, numbers)
        if pair is not None:
            raise Refused(DUPLICATE_PUBLISHER, pair.words)

    def _count_unknown(self, topic: str, fields: tuple[str, ...]) -> None:
        self.with_unknown_fields += 1
        for name in (f"{topic}.{field}" for field in fields):
            if name in self.unknown_fields or len(self.unknown_fields) < MAX_NAMES:
                self.unknown_fields[name] += 1

    def _checked(self, key: str, payload: bytes, now: int | None) -> tuple[Message, tuple[str, ...]]:
        address = parse(key)
        if address is None or address.mesh != self._mesh or address.topic not in self._topics:
            raise Refused("key", "not a key that this peer listens to")
        message, unknown = self.decoder(address.topic, payload)
        role = ROLE_OF_TOPIC.get(address.topic, message.src.partition("/")[0])
        if message.src != f"{role}/{address.name}":
            raise Refused("source", f"src is {message.src!r}, the key belongs to {role}/{address.name}")
        if address.name not in self._names.get(role, ()):
            raise Refused("unknown", f"the configuration has no {role} {address.name!r}")
        if message.model != self._digest:
            raise Refused("model", f"made for model {message.model}, this peer has {self._digest}")
        if now is not None and isinstance(message, Measurement | BankMeasurement | Input):
            check_live_time(self._configuration, message, now, has_waited=self.stood_still)
        self._check_shape(address.name, message)
        if isinstance(message, Measurement | BankMeasurement):
            message = placed(self._configuration, message)
        elif isinstance(message, Input):
            check_beginning(self._configuration, message)
        return message, unknown

    def _check_shape(self, name: str, message: Message) -> None:
        if isinstance(message, BankMessage):
            found, expected = self._check_instances(name, message)
        elif isinstance(message, Truth):
            found, expected = len(message.x), self._states
        elif isinstance(message, Input):
            found, expected = len(message.u), self._inputs
        elif isinstance(message, Measurement):
            found, expected = len(message.y), self._rows[name]
        elif isinstance(message, Prediction | Posterior | Smoothed):
            found, expected = len(message.lower), self._states
        elif isinstance(message, Suggestion):
            found, expected = len(message.rho), self._noises
            for sensor, widths in message.r.items():
                if len(widths) != self._rows.get(sensor):
                    raise Refused("shape", f"r of {sensor} has {len(widths)} numbers")
        else:
            return
        if found != expected:
            raise Refused("shape", f"{found} numbers, expected {expected}")
        counts_by_time = isinstance(message, Measurement | BankMeasurement) and is_timed(message)
        if message.step < 1 and not counts_by_time:
            raise Refused("step", "steps count from 1")
        if self._last is not None and message.step > self._last + 1:
            text = f"step {message.step} of a mesh that ends at step {self._last}"
            seconds = (self._last - message.step) / self._configuration.mesh.rate
            raise Refused("step", text, source=name, seconds=seconds)
        if isinstance(message, Fused) and message.policy not in POLICIES:
            known = ", ".join(POLICIES)
            raise Refused("policy", f"fused by policy {message.policy!r}, which this peer does not know ({known})")
        if (
            isinstance(message, Prediction | Posterior | Smoothed)
            and complexity(message.support) > self._most_generators
        ):
            raise Refused("complexity", f"more than {self._most_generators} generators or constraints")

    def _check_instances(self, name: str, message: BankMessage) -> tuple[int, int]:
        """Numbers per instance of a message of a bank, and how many there should be."""
        instances = self._configuration.instances
        count = 0 if instances is None else instances.count
        if message.instances != count:
            raise Refused("shape", f"{message.instances} instances, this mesh has {count}")
        if isinstance(message, BankTruth):
            return message.matrix("x").shape[1], self._states
        if isinstance(message, BankMeasurement):
            return message.matrix("y").shape[1], self._rows[name]
        assert isinstance(message, BankSets)
        return message.matrix("lower").shape[1], self._states

    def _is_new(self, key: str, message: Message) -> bool:
        identity = (key, message.boot)
        sequence = self._sequences.get(identity)
        if sequence is None:
            self._forget_old_boots(key)
            sequence = self._sequences[identity] = Sequence(message.seq)
        return sequence.admit(message.seq, message.sent_ns)

    def _forget_old_boots(self, key: str) -> None:
        known = [identity for identity in self._sequences if identity[0] == key]
        for identity in known[: max(0, len(known) - MAX_BOOTS + 1)]:
            self._gaps_of_forgotten += self._sequences.pop(identity).gaps


def most_generators(configuration: Configuration) -> int:
    """How many generators or constraints a set of this mesh may have at the most; more would cost others their time.

    Twice the largest limit of any filter or fusion, and what a time update adds; 4096 where a filter has no limit.
    """
    model = configuration.base_model
    limits = [settings.max_generators for settings in configuration.fusion.values()]
    for settings in configuration.filters.values():
        options = settings.options
        n, is_unlimited = model.state_count, options.get("reduce") is False
        usual = max(20, 3 * n) + n * settings.lag
        limits.append(UNLIMITED if is_unlimited else options.get("max_generators") or usual)
        limits.append(UNLIMITED if is_unlimited else int(options.get("order") or max(15, 3 * n)) * n)
    return min(UNLIMITED, 2 * max(limits, default=0) + 2 * model.state_count + model.rho.size + 64)


def complexity(support: SupportMessage) -> int:
    """The number of generators or of constraints of a set, whichever is larger; the sum over an intersection."""
    if isinstance(support, IntersectionMessage):
        return sum(complexity(part) for part in support.parts)
    if isinstance(support, OrthotopeMessage):
        return len(support.lower)
    columns = len(support.generators[0]) if support.generators else 0
    return max(columns, len(support.b)) if isinstance(support, ConstrainedZonotopeMessage) else columns
