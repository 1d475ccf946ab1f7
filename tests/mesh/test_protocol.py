"""The protocol's page says what the code does, and plain msgpack reads every message."""

from __future__ import annotations

import json
import re
from pathlib import Path

import msgpack
import msgspec
import pytest

from lsu_mesh.mesh.bank_messages import BANK_TYPES
from lsu_mesh.mesh.message_examples import example
from lsu_mesh.mesh.messages import TYPES, Message, decode, encode
from lsu_mesh.mesh.model_answer import ModelAnswer


@pytest.fixture(scope="module")
def page(root: Path) -> str:
    return (root / "docs" / "protocol.md").read_text()


def rows(page: str, heading: str) -> list[tuple[set[str], str]]:
    """Fields and type of each row in the tables below a heading."""
    section = page.split(f"# {heading}\n")[1].split("\n#")[0]
    cells = [row.split("|")[1:3] for row in section.splitlines() if row.startswith("| `")]
    return [(set(re.findall(r"`(\w+)`", names)), kind.strip()) for names, kind in cells]


def documented(page: str, heading: str) -> set[str]:
    """Fields in the tables below a heading."""
    return {field for names, _ in rows(page, heading) for field in names}


def defaults(topic: str) -> dict[str, str]:
    """Fields that may be missing, and what a reader takes for them, as the page writes it."""
    fields = msgspec.structs.fields(TYPES[topic])
    written = {
        field.name: field.default if field.default_factory is msgspec.NODEFAULT else field.default_factory()
        for field in fields
        if not field.required
    }
    return {name: "nil" if value is None else repr(value) for name, value in written.items()}


@pytest.mark.parametrize("topic", sorted(TYPES))
def test_the_page_lists_exactly_the_fields_of_a_topic(page: str, topic: str) -> None:
    fields = set(TYPES[topic].__struct_fields__)
    common = set(Message.__struct_fields__)
    listed = documented(page, f"`{topic}`")
    if topic == "fused":
        listed |= documented(page, "`posterior`")
    assert listed == (fields - common) | (common & set(defaults(topic))), (
        "and common fields with a default of their own"
    )
    assert documented(page, "Common fields") == common


@pytest.mark.parametrize("topic", sorted(TYPES))
def test_the_page_tells_which_fields_may_be_missing_and_what_stands_for_them(page: str, topic: str) -> None:
    listed = rows(page, f"`{topic}`") + (rows(page, "`posterior`") if topic == "fused" else [])
    told = {name: kind.partition(" = ")[2] for names, kind in listed for name in names if " = " in kind}
    assert told == defaults(topic)


def test_the_page_lists_exactly_the_fields_of_the_model_answer(page: str) -> None:
    assert documented(page, "The model query") == set(ModelAnswer.__struct_fields__)


@pytest.mark.parametrize("topic", sorted(TYPES))
def test_plain_msgpack_reads_what_we_write_and_we_read_what_it_writes(topic: str) -> None:
    message = example(topic)
    plain = msgpack.unpackb(encode(message))
    assert isinstance(plain, dict)
    assert set(plain) == set(TYPES[topic].__struct_fields__)
    assert decode(topic, msgpack.packb(plain)) == message


@pytest.mark.parametrize("topic", sorted(BANK_TYPES))
def test_the_page_lists_exactly_the_fields_of_a_topic_of_banks(page: str, topic: str) -> None:
    fields = set(BANK_TYPES[topic].__struct_fields__) - set(Message.__struct_fields__)
    assert documented(page, f"`{topic}`") - {"step"} == fields
    told = {
        name: kind.partition(" = ")[2] for names, kind in rows(page, f"`{topic}`") for name in names if " = " in kind
    }
    optional = {field.name: field.default for field in msgspec.structs.fields(BANK_TYPES[topic]) if not field.required}
    assert told == {name: "nil" if value is None else repr(value) for name, value in optional.items()}


def test_the_example_on_the_page_is_what_the_code_prints(page: str) -> None:
    shown = json.loads(page.split("```json\n")[1].split("```")[0])
    assert shown == msgpack.unpackb(encode(example("posterior")))


def test_every_topic_has_a_key_on_the_page(page: str) -> None:
    for topic in (*TYPES, *BANK_TYPES):
        assert f"`lsu/v1/M/{topic}/NAME`" in page
