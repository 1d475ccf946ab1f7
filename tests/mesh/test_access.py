"""Who may do what follows from the configuration, and every key has one owner."""

from __future__ import annotations

from pathlib import Path

import pytest

from lsu_mesh.mesh.access import Access, access, reader_access, taken_predictions
from lsu_mesh.mesh.config import Configuration, load
from lsu_mesh.mesh.keys import parse
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode


@pytest.fixture(scope="module")
def configuration(root: Path) -> Configuration:
    return load(root / "examples" / "mesh.toml", ["filters.box.transfer=fused", "filters.cz.transfer=predictor"])


def all_access(configuration: Configuration) -> dict[str, Access]:
    return {name: access(configuration, role, name) for role, name in configuration.peers()}


def test_every_key_has_one_publisher_whose_name_it_ends_with(configuration: Configuration) -> None:
    published = [(key, name) for name, may in all_access(configuration).items() for key in may.publishes]
    assert len({key for key, _ in published}) == len(published)
    for key, name in published:
        address = parse(key)
        assert address is not None
        assert address.name == name


def test_a_sensor_publishes_its_measurement_and_what_every_peer_does(configuration: Configuration) -> None:
    may = all_access(configuration)["s1"]
    assert may.publishes == tuple(f"lsu/v1/example/{topic}/s1" for topic in ("measurement", "health", "event"))
    assert may.reads == ("lsu/v1/example/truth/plant", "lsu/v1/example/health/s1")
    assert may.answers == ()


def test_only_filters_publish_posteriors_and_only_fusions_fused_sets(configuration: Configuration) -> None:
    roles = {name: role for role, name in configuration.peers()}
    for name, may in all_access(configuration).items():
        topics = {address.topic for key in may.publishes if (address := parse(key)) is not None}
        assert ("posterior" in topics) == (roles[name] == "filter")
        assert ("fused" in topics) == (roles[name] == "fusion")
        assert ("truth" in topics) == (roles[name] == "plant")


def test_a_filter_reads_its_sensors_inputs_transfers_and_fusion_and_no_truth(configuration: Configuration) -> None:
    reads = {name: set(may.reads) for name, may in all_access(configuration).items()}
    mesh = "lsu/v1/example"
    others = {f"{mesh}/prediction/{name}" for name in ("box", "para", "zonotope")}
    measured = {f"{mesh}/measurement/s2", f"{mesh}/measurement/s3"}
    reads = {name: {key for key in keys if "/health/" not in key} for name, keys in reads.items()}
    assert reads["cz"] == {*measured, f"{mesh}/input/plant", f"{mesh}/fused/main", *others}
    assert reads["para"] == {f"{mesh}/measurement/s1", f"{mesh}/input/plant", f"{mesh}/fused/main"}


def test_a_node_listens_to_what_it_may_read(configuration: Configuration) -> None:
    node = FilterNode(configuration, "box", "0" * 16)
    may = access(configuration, "filter", "box")
    own_health = ("health", "box")
    listened = [*node.subscriptions(), own_health]
    assert {f"lsu/v1/example/{topic}/{name}" for topic, name in listened} == set(may.reads)
    fusion = FusionNode(configuration, "main", "0" * 16)
    assert {name for _, name in fusion.subscriptions()} == {"box", "para", "cz", "plant"}


def test_a_recorder_reads_all_and_of_the_predictions_those_that_filters_take(root: Path) -> None:
    def read(*overrides: str) -> set[str]:
        found = load(root / "examples" / "mesh.toml", overrides)
        reads = access(found, "recorder", "recorder").reads
        assert set(reads) >= {f"lsu/v1/example/{topic}/*" for topic in ("truth", "measurement", "posterior", "event")}
        predictions = {key.rpartition("/")[2] for key in reads if "/prediction/" in key}
        assert predictions == {"*"} or predictions == taken_predictions(found)
        return predictions

    assert read() == set()
    assert read("filters.cz.transfer=fused") == set(), "a fused set is no prediction"
    assert read("filters.cz.transfer=predictor") == {"box", "para", "zonotope"}
    assert read("filters.cz.transfer=predictor", 'filters.cz.transfer_from=["box"]') == {"box"}
    assert read("recorder.predictions=true") == {"*"}


def test_readers_publish_nothing_and_answer_nothing(configuration: Configuration) -> None:
    may = reader_access(configuration)
    assert (may.publishes, may.answers) == ((), ())
    assert {f"lsu/v1/example/{topic}/*" for topic in ("posterior", "prediction")} <= set(may.reads)
