"""``lsu-mesh import BAG``: a file of measurements, which sensors play, from a bag of ROS 2."""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from lsu_mesh.mesh.data_files.spans import moment_text
from lsu_mesh_services.exit_codes import FAILURE, OK, USAGE
from lsu_mesh_services.ros2.bags import Bag, BagError, Row, Topic

NS = 10**9


class NoFile(Exception):
    """The file cannot be written; the message says why and what to do."""


def main(options: argparse.Namespace) -> int:
    try:
        with Bag(Path(options.file).expanduser()) as bag:
            if options.topic is None:
                return _listed(bag)
            topic = bag.topic(options.topic)
            if options.fields is None:
                return _described(bag, topic)
            return _imported(bag, topic, options)
    except BagError as error:
        print(error, file=sys.stderr)
        return USAGE
    except NoFile as error:
        print(error, file=sys.stderr)
        return FAILURE


def _listed(bag: Bag) -> int:
    topics = bag.topics()
    width = max((len(one.name) for one in topics), default=0)
    for one in topics:
        print(f"{one.name:{width}}  {one.messages:>8}  {one.type}")
    print("choose one by --topic", file=sys.stderr)
    return OK


def _described(bag: Bag, topic: Topic) -> int:
    """The fields of a type, when none is named."""
    print(
        f"{topic.name}: {topic.messages} messages of {topic.type}; choose numbers by --fields A,B of", file=sys.stderr
    )
    print("\n".join(bag.fields(topic)))
    return OK


def _imported(bag: Bag, topic: Topic, options: argparse.Namespace) -> int:
    fields = options.fields.split(",")
    has_header = bag.has_header(topic)
    if options.stamp == "header" and not has_header:
        raise BagError(f"{options.file}: {topic.type} has no header; leave out --stamp header")
    is_stamped = has_header if options.stamp is None else options.stamp == "header"
    rows = bag.rows(topic, fields, stamped=is_stamped)
    with _opened(options) as file:
        count, first, last = _written(file, fields, rows)
    for reason, left_out in bag.refused.items():
        print(f"{options.file}: {left_out} message(s) left out ({reason}): {bag.last_refusal}", file=sys.stderr)
    if not count:
        print(f"{options.file}: {topic.name} has no message that can be used", file=sys.stderr)
        return FAILURE
    written = options.output or "standard output"
    print(
        f"{written}: {count} rows of {topic.name} ({topic.type}), {moment_text(first)} to {moment_text(last)}",
        file=sys.stderr,
    )
    if not is_stamped:
        print(
            "the times are those at which the bag received the messages: give the sensor a time_error", file=sys.stderr
        )
    if options.output:
        print(f"next: lsu-mesh new mesh.toml --from file {options.output}", file=sys.stderr)
    return OK


@contextmanager
def _opened(options: argparse.Namespace) -> Iterator[TextIO]:
    """Standard output, or a file that is not there yet unless ``--force`` says so."""
    if not options.output:
        yield sys.stdout
        return
    try:
        with (
            Path(options.output).expanduser().open("w" if options.force else "x", encoding="utf-8", newline="") as file
        ):
            yield file
    except FileExistsError:
        raise NoFile(f"{options.output}: is there already; --force writes over it") from None
    except OSError as error:
        raise NoFile(f"{options.output}: cannot be written: {error.strerror}") from None


def _written(file: TextIO, fields: Sequence[str], rows: Iterator[Row]) -> tuple[int, int, int]:
    """How many rows, the earliest and the latest time; times are exact decimals with nine places."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["time", *fields])
    count, first, last = 0, 2**63, -(2**63)
    for row in rows:
        seconds, rest = divmod(row.time_ns, NS)
        writer.writerow([f"{seconds}.{rest:09d}", *("" if value is None else repr(value) for value in row.values)])
        count, first, last = count + 1, min(first, row.time_ns), max(last, row.time_ns)
    return count, first, last
