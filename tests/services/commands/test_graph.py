"""``lsu-mesh graph`` draws the edges of the configuration."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from lsu_mesh_services.cli import main
from lsu_mesh_services.commands import graph
from lsu_mesh_services.exit_codes import OK

from lsu_mesh.mesh.config import load
from lsu_mesh.mesh.flows import flows, in_order

EDGES = {
    ("plant", "s1"), ("plant", "s2"), ("plant", "s3"), ("plant", "box"), ("plant", "cz"), ("plant", "para"),
    ("plant", "main"), ("s1", "box"), ("s1", "para"), ("s2", "box"), ("s2", "cz"), ("s3", "cz"), ("box", "main"),
    ("cz", "main"), ("para", "main"), ("main", "box"), ("main", "cz"), ("main", "para"),
}  # fmt: skip


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["graph", *arguments]) == OK
    return capsys.readouterr().out


def test_text_names_each_key_with_its_readers(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys)
    assert "plant\n  truth/plant → s1, s2, s3, recorder\n" in text
    assert "filter cz\n  prediction/cz → no reader\n  posterior/cz  → main, recorder\n" in text
    assert "prediction/cz → recorder" in printed(capsys, "-X", "recorder.predictions=true")


def test_dot_has_the_edges_of_the_configuration(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "--dot")
    assert text.startswith("digraph mesh {")
    assert set(re.findall(r'"(\w+)" -> "(\w+)"', text)) == EDGES


def test_mermaid_has_the_same_edges(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "--mermaid")
    assert text.startswith("flowchart LR")
    names = dict(re.findall(r'(p\d+)\["(\w+)<br>', text))
    edges = re.findall(r"(p\d+) -->\|[\w, ]+\| (p\d+)", text)
    assert {(names[one], names[other]) for one, other in edges} == EDGES


def test_json_has_a_line_for_each_peer_and_key(capsys: pytest.CaptureFixture[str]) -> None:
    lines = [json.loads(line) for line in printed(capsys, "--json").splitlines()]
    assert next(line["name"] for line in lines if line["type"] == "peer") == "plant"
    (key,) = [line for line in lines if line["type"] == "key" and line["topic"] == "fused"]
    assert key["readers"] == ["box", "cz", "para", "recorder"]


def test_who_is_not_there_and_who_is_a_stranger_is_seen(demo: Path) -> None:
    configuration = load(demo)
    peers, own, there = in_order(configuration), flows(configuration), {"plant", "s1", "ghost"}
    text = graph.text(peers, own, there)
    assert "sensor s1 – there" in text
    assert "sensor s2 – not there" in text
    assert "ghost – there, but not of this configuration" in text
    assert '"s2" [label="s2\\nsensor", shape=oval, style=dashed]' in graph.dot(peers, own, there)
    assert "classDef away" in graph.mermaid(peers, own, there)
