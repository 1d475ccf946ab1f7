"""``source = "ros2"`` of a sensor, and ``[network.ros2]``: what is measured from ROS 2, and what is told to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from typing import get_args

from lsu_mesh.mesh.config.expected import shown
from lsu_mesh.mesh.config.problem import Problem, Problems, closest, nearest
from lsu_mesh.mesh.config.settings import NetworkSettings, SensorSettings
from lsu_mesh.mesh.config.table import Table
from lsu_mesh.mesh.ros2.fields import FIELD_RULE, NoSuchField, check_path, parse_path
from lsu_mesh.mesh.ros2.names import NAMESPACE_RULE, TOPIC_RULE, TYPE_RULE, is_namespace, is_topic, is_type
from lsu_mesh.mesh.ros2.settings import DIALECTS, DISTROS, Ros2Network, Ros2Publication, Ros2Topic, Stamp

KEYS = ("topic", "type", "fields", "stamp")
PUBLICATION_KEYS = ("estimator", "topic", "states", "frame_id", "diagnostics")
STAMPS: tuple[Stamp, ...] = get_args(Stamp)
DOMAINS = 232
"""The largest domain id that ROS 2 allows."""
MAX_STATES = 3
"""A point has x, y and z."""


def read_topic(table: Table, count: int | None, *, is_used: bool) -> Ros2Topic | None:
    """The keys of a sensor that listens to a topic; ``count`` is that of the rows of C, where they could be read."""
    topic, type_name = table.text("topic", None), table.text("type", None)
    fields = table.texts("fields", None)
    stamp = table.choice("stamp", STAMPS, "header")
    if not is_used:
        for key in KEYS:
            if key in table.values:
                table.without(key, 'has no effect without source = "ros2"', "remove it, or set the source")
        return None
    given = {"topic": TOPIC_RULE, "type": TYPE_RULE, "fields": f"a list of strings, each {FIELD_RULE}"}
    for key, rule in given.items():
        if key not in table.values:
            table.wrong(key, f'is missing; source = "ros2" needs {rule}', rule)
    if topic is not None and not is_topic(topic):
        table.wrong("topic", f"{shown(topic)} is no topic; expected {TOPIC_RULE}", TOPIC_RULE)
    if type_name is not None and not is_type(type_name):
        table.wrong("type", f"{shown(type_name)} is no type; expected {TYPE_RULE}", TYPE_RULE)
    for field in fields or ():
        if parse_path(field) is None:
            table.wrong("fields", f"{shown(field)} is no path; expected {FIELD_RULE}", FIELD_RULE)
    if fields is not None and count is not None and len(fields) != count:
        table.mismatch("fields", f"{count} paths, one per row of C", len(fields))
    if stamp == "receive" and "time_error" not in table.values:
        text = 'is missing; stamp = "receive" needs the longest time from a measurement to its arrival'
        table.wrong("time_error", text, 'a time such as "20ms"')
    return Ros2Topic(topic or "", type_name or "", tuple(fields or ()), stamp)


def read_ros2_network(network: Table) -> Ros2Network:
    """``[network.ros2]``; the endpoints are checked by the caller."""
    table = network.table("ros2") or Table({}, "network.ros2", network.problems)
    connect = tuple(table.texts("connect", list(Ros2Network.connect)))
    listen = tuple(table.texts("listen", []))
    domain_id = table.whole("domain_id", Ros2Network.domain_id, high=DOMAINS)
    dialect = table.choice("dialect", DIALECTS, Ros2Network.dialect)
    namespace = table.text("namespace", Ros2Network.namespace)
    if not is_namespace(namespace):
        text = f"{shown(namespace)} is no namespace; expected {NAMESPACE_RULE}"
        table.wrong("namespace", text, NAMESPACE_RULE)
    distro = table.choice("distro", DISTROS, Ros2Network.distro)
    table.problems.asked |= {f"{table.path}.publish[0].{key}" for key in PUBLICATION_KEYS}
    publish = tuple(_read_publication(item) for item in table.tables("publish"))
    table.finish()
    return Ros2Network(
        connect=connect,
        listen=listen,
        domain_id=domain_id,
        dialect=dialect,
        namespace=namespace,
        distro=distro,
        publish=publish,
    )


def _read_publication(table: Table) -> Ros2Publication:
    estimator, topic = table.text("estimator"), table.text("topic")
    if isinstance(topic, str) and not is_topic(topic):
        table.wrong("topic", f"{shown(topic)} is no topic; expected {TOPIC_RULE}", TOPIC_RULE)
    states = table.texts("states")
    states = states if isinstance(states, list) else []
    if len(states) > MAX_STATES or (not states and "states" in table.values):
        table.mismatch("states", "one to three states, which are x, y and z", len(states))
    frame_id = table.text("frame_id", "map")
    diagnostics = table.flag("diagnostics", True)
    table.finish()
    return Ros2Publication(str(estimator), str(topic), tuple(states), frame_id=frame_id, diagnostics=diagnostics)


def check_ros2(
    network: NetworkSettings,
    sensors: Mapping[str, SensorSettings],
    estimators: Iterable[str],
    states: Sequence[str] | None,
    *,
    problems: Problems,
) -> None:
    """Types and fields by the release of ROS 2, where rosbags is installed; estimators and states that are told."""
    _check_publications(network.ros2, list(estimators), states, problems)
    measured = {name: sensor.ros2 for name, sensor in sensors.items() if sensor.ros2 is not None}
    if not measured or find_spec("rosbags") is None:
        return
    for name, topic in measured.items():
        if is_type(topic.type):
            _check_type(f"sensors.{name}", topic, network.ros2, problems)


def _check_type(table: str, topic: Ros2Topic, network: Ros2Network, problems: Problems) -> None:
    from lsu_mesh.mesh.ros2.decoder import has_header, types_of

    store, found = types_of(network.distro), shown(topic.type)
    known = [name for name in store.fielddefs if is_type(name)]
    if topic.type not in known:
        text = f"ROS 2 {network.distro} has no {found}; {nearest(topic.type, known)}"
        expected = f"a message type of ROS 2 {network.distro}"
        problems.add(table, "type", text, expected=expected, found=found, nearest=closest(topic.type, known))
        return
    if topic.stamp == "header" and not has_header(store, topic.type):
        text = f'{topic.type} has no header; set stamp = "receive", and time_error'
        problems.add(table, "stamp", text, expected='"receive"')
    for field in topic.fields:
        try:
            if parse_path(field) is not None:
                check_path(store, topic.type, field)
        except NoSuchField as error:
            hint = f"; {nearest(error.name, error.known)}" if error.known else ""
            near = closest(error.name, error.known) if error.known else None
            expected = f"a number of {topic.type}"
            problems.add(table, "fields", f"{error}{hint}", expected=expected, found=shown(field), nearest=near)


def _check_publications(
    network: Ros2Network, estimators: Sequence[str], states: Sequence[str] | None, problems: Problems
) -> None:
    for i, one in enumerate(network.publish):
        table = f"network.ros2.publish[{i}]"
        if problems.are_in(table):
            continue
        if one.estimator not in estimators:
            text = f'"{one.estimator}" is not defined; {nearest(one.estimator, estimators)}'
            near = closest(one.estimator, estimators)
            problems.add(
                table, "estimator", text, expected="a filter or a fusion", found=shown(one.estimator), nearest=near
            )
        known = one.states if states is None else states
        for state in one.states:
            if state not in known:
                text = f'there is no state "{state}"; {nearest(state, known)}'
                near = closest(state, known)
                problems.add(table, "states", text, expected="states of the model", found=shown(state), nearest=near)


def ros2_warnings(file: str, network: NetworkSettings, sensors: Mapping[str, SensorSettings]) -> list[Problem]:
    """The mesh's own entry where the router of ROS 2 listens: only one of them can."""
    is_used = bool(network.ros2.publish) or any(sensor.ros2 is not None for sensor in sensors.values())
    same = [one for one in network.ros2.connect if _address(one) == _address(network.entry)]
    if not is_used or not same:
        return []
    text = (
        f"is {network.entry}, where the router of ROS 2 is looked for too ([network.ros2] connect): if one runs there, "
        'the mesh cannot listen; choose another, such as "tcp/127.0.0.1:7448"'
    )
    return [
        Problem(file=file, table="network", key="entry", text=text, expected="another port", found=shown(network.entry),
                is_warning=True)
    ]  # fmt: skip


def _address(endpoint: str) -> str:
    address = endpoint.partition("/")[2]
    return address.replace("localhost", "127.0.0.1").replace("[::1]", "127.0.0.1")
