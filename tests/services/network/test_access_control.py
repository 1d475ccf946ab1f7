"""The rules that Zenoh gets: every rule is used, names what it should, and nothing is allowed to all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from lsu_mesh_services.network.access_control import zenoh_access_control

from lsu_mesh.mesh.config import load


@pytest.fixture(scope="module")
def rules(demo: Path) -> dict[str, Any]:
    return zenoh_access_control(load(demo))


def of(rules: dict[str, Any], name: str, message: str, flow: str) -> set[str]:
    """Key expressions of what a name may send (ingress) or be sent (egress)."""
    (policy,) = [policy for policy in rules["policies"] if policy["subjects"] == [name]]
    own = [rule for rule in rules["rules"] if rule["id"] in policy["rules"]]
    chosen = [rule for rule in own if message in rule["messages"] and flow in rule["flows"]]
    return {key for rule in chosen for key in rule["key_exprs"]}


def test_what_is_not_allowed_is_denied_and_identities_are_unique(rules: dict[str, Any]) -> None:
    assert rules["enabled"] is True
    assert rules["default_permission"] == "deny"
    assert {rule["permission"] for rule in rules["rules"]} == {"allow"}
    identities = [rule["id"] for rule in rules["rules"]]
    assert len(set(identities)) == len(identities)
    used = {identity for policy in rules["policies"] for identity in policy["rules"]}
    assert used == set(identities)


def test_every_subject_is_one_certificate(rules: dict[str, Any]) -> None:
    names = {"recorder", "main", "box", "cz", "para", "s1", "s2", "s3", "plant", "viewer", "router"}
    assert {subject["id"]: subject["cert_common_names"] for subject in rules["subjects"]} == {n: [n] for n in names}


def test_a_sensor_sends_its_own_keys_and_the_advanced_messages_beside_them(rules: dict[str, Any]) -> None:
    own = {f"lsu/v1/demo/{topic}/s1" for topic in ("measurement", "health", "event")}
    assert of(rules, "s1", "put", "ingress") == own | {f"{key}/@adv/**" for key in own}
    assert of(rules, "s1", "reply", "ingress") == own | {f"{key}/@adv/**" for key in own}
    assert of(rules, "s1", "put", "egress") == {
        "lsu/v1/demo/truth/plant", "lsu/v1/demo/truth/plant/@adv/**", "lsu/v1/demo/health/s1",
        "lsu/v1/demo/health/s1/@adv/**", "lsu/v1/demo/model",
    }  # fmt: skip


def test_a_reader_sends_no_data_and_no_token(rules: dict[str, Any]) -> None:
    for message in ("put", "delete", "reply", "declare_queryable", "liveliness_token"):
        assert of(rules, "viewer", message, "ingress") == set()
    assert "lsu/v1/demo/posterior/*" in of(rules, "viewer", "put", "egress")


def test_only_a_router_passes_on_what_others_send(rules: dict[str, Any]) -> None:
    everything = "lsu/v1/demo/**"
    able = [s["id"] for s in rules["subjects"] if everything in of(rules, s["id"], "put", "ingress")]
    assert able == ["router"]
