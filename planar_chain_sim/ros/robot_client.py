"""
An ordinary ROS client of one planar robot: sees its description, states, events and diagnostics, and commands it.

It needs robot_description and joint_states alone, as every robot has them. Efforts, wrenches, services and parameters
are those of this package's node; where they are missing, `abilities` says so.
"""
from __future__ import annotations

from math import nan
from time import monotonic
from typing import Any, Callable, Mapping, Optional, Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from .messages import COMMANDS, INPUTS, OUTPUTS, PolledGroup, SIDE_OUTPUTS
from ..recording.cdr import CdrError, decode_joint_state
from ..recording.events import decode_event

LOOK_PERIOD = 1.0    # s between two looks at the graph
DELIVERY_TIME = 1.0  # s that the last message of a publisher has to arrive
SERVICES = {'pause': SetBool, 'step': Trigger, 'reset': Trigger}
UNNAMED = '_NODE_NAME_UNKNOWN_'   # until discovery knows more


def _never_called(message) -> None:
    """Do nothing: the subscriptions are polled."""


class RobotClient:
    """
    The robot whose joint_states come on that topic, seen by `node`. All but `states` is used by one thread.

    `wanted`: parameters of the robot's node to be read. `complain(sentence)`: what could not be done.
    description: the newest text of robot_description. name: the full name of the robot's node, '' while unknown;
    generation: changes when another node, or a new one of the same name, has taken its place. parameters: values of
    `wanted`, {} if the node does not have them. last_state: when the newest state came, s of monotonic().
    """

    def __init__(self, node, wanted: Sequence[str], complain: Callable[[str], None]):
        self._node, self._wanted, self._complain = node, list(wanted), complain
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        # Best effort: whoever cannot keep up misses a state, and the robot does not wait for anybody.
        self._states = self._polled(JointState, OUTPUTS['state'].name, 10, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._descriptions = self._polled(String, SIDE_OUTPUTS['description'].name, 1,
                                          durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._diagnostics = self._polled(DiagnosticArray, SIDE_OUTPUTS['diagnostics'].name, 10)
        self._events: Any = None
        self._joints: dict[str, tuple] = {}
        self._stamp, self.last_state = 0, 0.0
        self._clients: dict[str, Any] = {}
        self._setter: Any = None
        self._to_set: dict[str, Any] = {}
        self._setting = ''
        self._commands: Any = None
        self._silent = 0.0   # when the publisher of commands may go
        self._wrenches: Any = None
        self._looked = 0.0
        self.name, self.description, self.generation = '', '', 0
        self._publisher: Any = None
        self.parameters: dict[str, Any] = {}
        self.abilities: frozenset = frozenset()

    def _polled(self, message: type, topic: str, depth: int, **qos):
        return self._node.create_subscription(message, topic, _never_called, QoSProfile(depth=depth, **qos),
                                              callback_group=PolledGroup())

    @property
    def state_topic(self) -> str:
        """The full name of the topic of states."""
        return self._states.topic_name

    def turn(self, seconds: float) -> None:
        """Serve what has come, for at most so long."""
        self._executor.spin_once(timeout_sec=seconds)
        for text in _taken(self._descriptions):
            self.description = text.data
        now = monotonic()
        if now - self._looked >= LOOK_PERIOD:
            self._looked = now
            self._look()
        if self._commands is not None and 0.0 < self._silent < now:
            self._node.destroy_publisher(self._commands)
            self._commands = None

    def states(self, names: Sequence[str]) -> Optional[tuple[int, list]]:
        """Return the newest stamp, ns, and position, velocity, effort of each joint; None as long as one is missing."""
        seen: set = set()
        for newest, data in enumerate(reversed(_taken(self._states, raw=True))):
            try:
                state = decode_joint_state(data)
            except CdrError as error:
                self._complain(f'a message on {self.state_topic} cannot be read: {error}')
                continue
            if not newest:
                self._stamp, self.last_state = state.stamp, monotonic()
            count = len(state.names)
            columns = [column if len(column) == count else count * (nan,)
                       for column in (state.position, state.velocity, state.effort)]
            self._joints.update({name: row for name, row in zip(state.names, zip(*columns)) if name not in seen})
            seen.update(state.names)
            if seen.issuperset(names):   # as after the first one, where one node publishes all joints
                break
        rows = [self._joints.get(name) for name in names]
        return None if None in rows else (self._stamp, rows)

    def events(self) -> list[dict]:
        """Return the events that have come."""
        found = []
        for data in _taken(self._events, raw=True) if self._events else ():
            try:
                found.append(decode_event(data))
            except ValueError as error:
                self._complain(f'a message on {self._events.topic_name} is no event: {error}')
        return found

    def diagnostics(self) -> dict[str, str]:
        """Return the values of the newest report of the robot's simulation, and what it says as 'message'."""
        values: dict[str, str] = {}
        wanted = f'{self.name.lstrip("/")}: simulation'
        for array in _taken(self._diagnostics):
            for status in array.status:
                if status.name == wanted:
                    values = {each.key: each.value for each in status.values}
                    good = status.level == DiagnosticStatus.OK
                    values['message'] = status.message.partition(',')[0] if good else status.message
        return values

    def _look(self) -> None:
        """Find the robot's node and what it offers."""
        node = self._node
        services = {name for name, _ in node.get_service_names_and_types()}
        owners = [(f'{each.node_namespace.rstrip("/")}/{each.node_name}', tuple(each.endpoint_gid))
                  for each in node.get_publishers_info_by_topic(self.state_topic) if each.node_name != UNNAMED]
        owner = next((each for each in owners if f'{each[0]}/pause' in services), owners[0] if owners else None)
        if owner and owner != self._publisher:
            self._publisher = owner
            self._join(owner[0])
        abilities = {key for key, client in self._clients.items() if client.service_is_ready()}
        if self.name:
            for ability, row in (('effort', COMMANDS['joint_commands']), ('pull', INPUTS['wrench'])):
                if node.count_subscribers(self._topic(row.name)):
                    abilities.add(ability)
            if self.parameters and self._setter.services_are_ready():
                abilities.update(self.parameters)
        self.abilities = frozenset(abilities) if owners else frozenset()

    def elsewhere(self) -> list[str]:
        """Return other topics that carry joint states."""
        return [topic for topic, types in self._node.get_topic_names_and_types()
                if 'sensor_msgs/msg/JointState' in types and topic.endswith('/joint_states')
                and topic != self.state_topic and self._node.count_publishers(topic)]

    def _topic(self, name: str) -> str:
        """Return a topic or service of the robot's node in full."""
        return name.replace('~', self.name)

    def _join(self, name: str) -> None:
        """Take a node for the robot's."""
        for former in (self._events, self._wrenches, self._commands):
            if former is not None:
                (self._node.destroy_subscription if former is self._events else self._node.destroy_publisher)(former)
        for client in self._clients.values():
            self._node.destroy_client(client)
        self.name, self._commands, self.parameters, self.generation = name, None, {}, self.generation + 1
        self._events = self._polled(String, self._topic(OUTPUTS['events'].name), 1000)
        self._wrenches = self._node.create_publisher(WrenchStamped, self._topic(INPUTS['wrench'].name), 10)
        self._clients = {key: self._node.create_client(kind, f'{name}/{key}') for key, kind in SERVICES.items()}
        self._setter = AsyncParameterClient(self._node, name)
        self._to_set, self._setting = {}, ''

    def ask_parameters(self) -> None:
        """Read the parameters; they are in `parameters` as soon as the node has answered."""
        if self._setter is not None and self._setter.services_are_ready():
            self._setter.get_parameters(self._wanted, lambda future: self._read(future.result()))

    def _read(self, answer) -> None:
        if len(answer.values) == len(self._wanted):   # none come from a node that lacks one
            values = {name: parameter_value_to_python(value) for name, value in zip(self._wanted, answer.values)}
            self.parameters = {name: list(value) if hasattr(value, 'tolist') else value
                               for name, value in values.items()}

    def call(self, service: str, *data: bool) -> None:
        """Call 'pause' (with a flag), 'step' or 'reset'."""
        client = self._clients.get(service)
        if client is None or not client.service_is_ready():
            self._complain(f'this robot has no service {self._topic(f"~/{service}")}')
            return
        request = client.srv_type.Request(**({'data': data[0]} if data else {}))
        client.call_async(request).add_done_callback(lambda future: self._answered(service, future))

    def _answered(self, service: str, future) -> None:
        if future.exception() is None and not future.result().success:
            self._complain(f'{service}: {future.result().message}')

    def set(self, name: str, value: Any) -> None:
        """Set a parameter; of several values that follow quickly the last one counts."""
        self._to_set[name] = value
        self._set_next()

    def _set_next(self) -> None:
        if self._setting or not self._to_set or self._setter is None:
            return
        self._setting = next(iter(self._to_set))
        parameter = Parameter(self._setting, value=self._to_set.pop(self._setting))
        self._setter.set_parameters([parameter], self._is_set)

    def _is_set(self, future) -> None:
        self._setting = ''
        if future.exception() is None:
            for result in future.result().results:
                if not result.successful:
                    self._complain(result.reason)
        self._set_next()

    def command(self, efforts: Mapping[str, float], last: bool) -> None:
        """
        Publish efforts by joint, N m or N; to be repeated, with a 0 for each joint at the end.

        `last`: nothing more will follow, and the publisher is removed, so that the node notices when its last
        controller has gone.
        """
        if self._commands is None:
            self._commands = self._node.create_publisher(JointState, self._topic(COMMANDS['joint_commands'].name), 10)
        self._commands.publish(JointState(name=[*efforts], effort=[*efforts.values()]))
        self._silent = monotonic() + DELIVERY_TIME if last else 0.0

    def push(self, body: str, force: complex = 0j, moment: float = 0.0) -> None:
        """Publish a wrench on a body, in its axes, N and N m."""
        if self._wrenches is None:
            return
        message = WrenchStamped()
        message.header.frame_id = body
        message.wrench.force.x, message.wrench.force.y, message.wrench.torque.z = force.real, force.imag, moment
        self._wrenches.publish(message)

    def close(self) -> None:
        """Wait until the robot has received what was published, then shut the executor down."""
        for publisher in (self._commands, self._wrenches):
            if publisher is not None:
                publisher.wait_for_all_acked(Duration(seconds=DELIVERY_TIME))
        self._executor.shutdown()


def _taken(subscription, raw: bool = False) -> list:
    """Return the messages that have come."""
    found = []
    with (handle := subscription.handle):
        while (message := handle.take_message(subscription.msg_type, raw)) is not None:
            found.append(message[0])
    return found
