"""Faults of other nodes on the same topics (type, QoS, name): checked once a second, each reported once."""
from __future__ import annotations

from rclpy.qos import qos_check_compatible, QoSCompatibility

PERIOD = 1.0  # s


class Neighbours:
    """
    Checks the ROS graph for `node` and reports each new fault through `simulator`.

    `inputs`, `publishers`: key of INPUTS or OUTPUTS -> subscription, publisher. faults: sentences on what is wrong at
    the last check().
    """

    def __init__(self, node, simulator, inputs, publishers):
        self._node, self._simulator = node, simulator
        self._inputs, self._publishers = inputs, publishers
        self._reported, self.faults = set(), []

    def check(self) -> None:
        """Check the graph now."""
        found = {key: fault for key, *fault in self._simulator.hold_ups.during(tuple, self._found())}
        self.faults = [sentence for _, _, sentence in found.values()]
        self._reported.intersection_update(found)
        for key in found.keys() - self._reported:
            done, _ = self._simulator.ignore(*found[key])
            if done:   # else a tick takes long: next time
                self._reported.add(key)

    def _found(self):
        """Yield (key, topic, reason, sentence) of each fault."""
        node = self._node
        own = node.get_fully_qualified_name()
        names = [f'{namespace.rstrip("/")}/{name}' for name, namespace in node.get_node_names_and_namespaces()]
        if names.count(own) > 1:
            yield own, '', 'same name', (f'another node is called {own} too, or was killed some seconds ago: both get '
                                         'the same commands; give one another name or namespace, '
                                         '--ros-args -r __node:=NAME or -r __ns:=/NAME')
        for own_end in (*self._inputs.values(), *self._publishers.values()):
            topic, wanted = own_end.topic_name, type_name(own_end.msg_type)
            others = node.get_publishers_info_by_topic(topic)
            for other in others:
                key, who = (topic, tuple(other.endpoint_gid)), f'a publisher of {named(other)} on {topic}'
                if other.topic_type != wanted:
                    yield key, topic, 'other type', (f'{who} has the type {other.topic_type}, must be {wanted}: '
                                                     'its messages do not arrive')
                elif own_end in self._inputs.values():
                    fits, why = qos_check_compatible(other.qos_profile, own_end.qos_profile)
                    if fits == QoSCompatibility.ERROR:
                        why = why.replace('ERROR: ', '').rstrip('; ')
                        yield key, topic, 'other QoS', (
                            f'messages from {who} do not arrive ({why}): make it reliable, or start this node with '
                            f'-p qos_overrides.{topic}.subscription.reliability:=best_effort')
            if topic == '/clock' and len(others) > 1:
                yield topic, topic, 'second clock', (f'{len(others)} nodes publish /clock, '
                                                     f'{", ".join(map(named, others))}: listeners see time jump')


def type_name(message: type) -> str:
    """Return the name of a message class as ROS writes it."""
    package, kind, _ = message.__module__.split('.', 2)
    return f'{package}/{kind}/{message.__name__}'


def named(end) -> str:
    """Return the full name of the node that an endpoint belongs to, '' where the graph does not know it yet."""
    return f'{end.node_namespace.rstrip("/")}/{end.node_name}'
