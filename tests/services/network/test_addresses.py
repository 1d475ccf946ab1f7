"""Topics as people write them."""

from __future__ import annotations

from pathlib import Path

import pytest
from lsu_mesh_services.network.addresses import WrongAddress, read_address

from lsu_mesh.mesh.config import Configuration, load


@pytest.fixture(scope="module")
def configuration(demo: Path) -> Configuration:
    return load(demo)


@pytest.mark.parametrize("text", ["posterior", "posterior/", "posterior/*", "lsu/v1/demo/posterior/*"])
def test_a_topic_alone_means_all_its_publishers(configuration: Configuration, text: str) -> None:
    assert read_address(configuration, text) == [("posterior", "box"), ("posterior", "cz"), ("posterior", "para")]


@pytest.mark.parametrize("text", ["fused/main", "lsu/v1/demo/fused/main"])
def test_a_name_or_a_whole_key_means_one(configuration: Configuration, text: str) -> None:
    assert read_address(configuration, text) == [("fused", "main")]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("posteriors/cz", "no peer publishes a topic 'posteriors'; did you mean \"posterior/cz\"?"),
        ("mesurement", 'did you mean "measurement"?'),
        ("posterior/cs", "no 'cs' publishes posterior; did you mean \"posterior/cz\"?"),
        ("measurement/plant", "no 'plant' publishes measurement"),
        ("lsu/v1/other/fused/main", "the mesh of this configuration is 'demo'"),
        ("bounds", "no peer publishes a topic 'bounds'"),
    ],
)
def test_a_wrong_one_names_the_nearest(configuration: Configuration, text: str, words: str) -> None:
    with pytest.raises(WrongAddress) as caught:
        read_address(configuration, text)
    assert words in str(caught.value)
