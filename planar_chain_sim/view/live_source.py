"""A robot in ROS, ours or another: what it says, and what pages ask of it."""
from __future__ import annotations

from collections import deque
from math import inf
from time import monotonic
from typing import Any, Callable, Mapping, Optional, Sequence
import warnings

import numpy as np

from .grips import Grips
from .scene import Scene, State
from .source import Source
from ..chain.chain import Chain
from ..chain.quantities import changed_chain, QUANTITIES
from ..chain_file import chain_from_text, load_chain
from ..errors import ChainError, Mistake
from ..mechanics.body_poses import body_poses
from ..mechanics.loads import with_payload, Wrench

PERIOD, HOLDING_PERIOD = 0.05, 0.01   # s between two turns, and while a page holds something
STALE = 2.5     # s without a state after which the page says so; a paused node sends one a second
SETTINGS = ('gravity', 'damping', 'real_time_factor', 'payload_mass')
CONTROLS = ('pause', 'step', 'reset', 'effort', 'pull', *SETTINGS)
PARAMETERS = (*SETTINGS, 'effort_limit', 'payload_body', 'payload_position', 'chain_file', 'hold', 'lockstep')
PLACES, MASSES = 1e-6, 0.01   # relative to max(1, |value|): by what a URDF may differ from its chain file


class LiveSource(Source):
    """
    The robot whose joint_states come to an rclpy node, see ros/robot_client.py.

    Its chain is that of its robot_description; of this package's node that of the chain file that it names, if that
    says the same and more.
    """

    kind = 'live'

    def __init__(self, node) -> None:
        super().__init__()
        from ..ros.robot_client import RobotClient
        self._robot = RobotClient(node, PARAMETERS, self.complaints.say)
        self._grips = Grips()
        self._requests: deque[Callable[[], None]] = deque()
        self._taken = '', 0                      # description and generation of the robot that is shown
        self._bare: Optional[Chain] = None       # without payload, as the robot's files say
        self._chain: Optional[Chain] = None
        self._values: dict[str, Any] = {}
        self._wrenches: dict[str, Wrench] = {}
        self._paused: Optional[bool] = None      # as events say, and the first report
        self._said, self._fault = '', ''
        self._factor = self._lateness = np.nan
        self._begin: Optional[int] = None        # stamp of the first state, ns
        self._last: Optional[tuple] = None
        self._state: Optional[State] = None
        self._held: dict[str, float] = {}
        self._pulled: set = set()
        self._tell_status()

    def leave(self, page: Any) -> None:
        """Let go of all that a page holds."""
        self._grips.release(page)

    def states(self) -> Optional[Sequence[State]]:
        """Return the newest state, read now."""
        chain = self._chain
        if chain is None:
            return None
        found = self._robot.states(chain.joint_names)
        if found is None:
            return None
        key = found, chain, dict(self._wrenches), self._factor, self._lateness
        if self._state is None or key != self._last:
            stamp, rows = found
            if self._begin is None or stamp < self._begin:
                self._begin = stamp if stamp > 1e18 else 0   # of wall time the beginning is shown as 0
            position, velocity, effort = np.array(rows, float).reshape(-1, 3).T
            if not np.isfinite(position).all():
                return None
            self._last = key
            self._state = State((stamp - self._begin) * 1e-9, np.nan, position, velocity, effort, dict(self._wrenches),
                                self._factor, self._lateness)
        return [self._state]

    def act(self, page: Any, action: Mapping[str, Any]) -> None:
        """Do what a page asks for; Mistake: it has no effect."""
        do, chain, robot = action['do'], self._chain, self._robot
        if do == 'release':
            self._grips.release(page)
            return
        wanted = action['name'] if do == 'set' else do
        if chain is None or wanted not in self._offered() or do == 'set' and wanted not in SETTINGS:
            raise Mistake(f'this robot does not offer {wanted!r:.80}')
        if do == 'effort':
            self._grips.hold(page, chain, action['joint'], action['value'])
        elif do == 'pull':
            state = self._state
            if state is not None:
                self._grips.pull(page, chain, state.position, action['body'], action['point'], action['to'])
        elif do == 'set':
            self._requests.append(lambda: robot.set(action['name'], action['value']))
        else:
            self._requests.append(lambda: robot.call(do, *([action['value']] if do == 'pause' else [])))

    # What follows runs in a thread of its own.

    def _run(self) -> None:
        robot, looked = self._robot, 0.0
        while not self._stopping:
            robot.turn(HOLDING_PERIOD if self._held or self._pulled else PERIOD)
            while self._requests:
                self._requests.popleft()()
            for event in robot.events():
                self._hear(event)
            if robot.description and (robot.description, robot.generation) != self._taken:
                self._take(robot.description, robot.generation)
            if self._values.keys() != robot.parameters.keys():
                self._values = dict(robot.parameters)
                self._adopt()
            self._act_on_grips()
            if monotonic() - looked > 0.5:
                looked = monotonic()
                self._look()
        self._grips.clear()
        self._act_on_grips()
        robot.close()

    def _take(self, text: str, generation: int) -> None:
        """Take the robot that a text describes."""
        self._taken, self._values = (text, generation), {}
        self._robot.parameters = {}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')   # notes about the file
                self._bare = chain_from_text(text, 'robot_description')
            self._fault = ''
        except ChainError as error:
            self._bare, self._fault = None, str(error)
        self._begin, self._wrenches, self._paused = None, {}, None
        self._grips.clear()
        self._adopt()

    def _adopt(self) -> None:
        """Show the robot as it is described, with the values of its parameters."""
        chain, values = self._bare, self._values
        own = 0
        if chain is not None and values:
            chain = self._named_chain(chain) or chain
            own = len(chain.bodies)
            try:
                for name in QUANTITIES:
                    chain = changed_chain(chain, name, [inf if each is None else each for each in values[name]])
                if values['payload_mass']:
                    body = values['payload_body'] or chain.bodies[-1].name
                    chain = with_payload(chain, body, values['payload_mass'], values['payload_position'], 0.0,
                                         'payload')
            except ValueError as error:
                self.complaints.say(f'the arm is drawn as its description says: {error}')
        self._chain = chain
        self.show([] if chain is None else [Scene(chain, own or len(chain.bodies))])
        self._tell_status()

    def _named_chain(self, described: Chain) -> Optional[Chain]:
        """Return the chain of the file that the robot's node names, if it is the one described; None: it is another."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')
                chain = load_chain(self._values['chain_file'], self._values['hold'])
        except Mistake:
            return None
        return chain if _says_the_same(chain, described) else None

    def _hear(self, event: Mapping[str, Any]) -> None:
        """Note an event of the robot."""
        kind, data = event['kind'], event['data']
        self.events.say(event)
        try:
            if kind == 'wrench':
                wrench = Wrench(complex(*data['force']), float(data['moment']), data['axes'])
                self._wrenches = {**self._wrenches, data['body']: wrench}
                if not wrench.force and not wrench.moment:
                    del self._wrenches[data['body']]
            elif kind == 'reset':
                self._wrenches = {}
            elif kind in ('pause', 'resume'):
                self._paused = kind == 'pause'
                self._tell_status()
            elif kind == 'parameter' and data['name'] in self._values:
                self._values[data['name']] = data['value']
                self._adopt()
            elif kind == 'payload' and self._values:
                self._values.update(payload_mass=data['mass'], payload_body=data['body'],
                                    payload_position=data['position'])
                self._adopt()
        except (KeyError, TypeError, ValueError) as error:
            self.complaints.say(f'an event {kind!r:.80} cannot be understood: {error!r:.200}')

    def _act_on_grips(self) -> None:
        """Publish what pages hold, and once the end of what they have let go."""
        chain, state = self._chain, self._state
        efforts = self._grips.efforts()
        if efforts or self._held:
            self._robot.command({**dict.fromkeys(self._held, 0.0), **efforts}, last=not efforts)
            self._held = efforts
        pulls = {pull.body: pull for pull in self._grips.pulls()}
        for body in self._pulled - {*pulls}:
            self._robot.push(body)
        self._pulled = {*pulls}
        if pulls and chain is not None and state is not None:
            states = self.states()
            for pull in pulls.values():
                if states and pull.body in chain.body_index:
                    force, moment, angle = pull.load(chain, states[0].position, np.nan_to_num(states[0].velocity))
                    self._robot.push(pull.body, force * np.exp(-1j * angle), moment)

    def _look(self) -> None:
        """See what has changed about the robot."""
        robot = self._robot
        if robot.name and not robot.parameters:
            robot.ask_parameters()
        report = robot.diagnostics()
        if report:
            self._factor = float(report.get('real_time_factor', 'nan'))
            self._lateness = float(report.get('lateness mean, s', 'nan'))
            self._said = '' if report['message'] in ('running', 'paused') else report['message']
            if self._paused is None:   # later reports may be older than events
                self._paused = report['message'] == 'paused'
        self._tell_status()

    def _offered(self) -> frozenset:
        """Return what pages may ask for; in lockstep efforts are answers of a controller to single states."""
        return self._robot.abilities - ({'effort'} if self._values.get('lockstep') else set())

    def _tell_status(self) -> None:
        robot, fault = self._robot, self._fault
        age = monotonic() - robot.last_state
        if fault:
            sentence = fault
        elif not robot.description:
            elsewhere = robot.elsewhere()
            sentence = 'waiting for robot_description' + (
                f'; there are states on {", ".join(elsewhere[:8])}: view --ros-args -r __ns:='
                f'{elsewhere[0].rpartition("/")[0] or "/"}' if elsewhere else '')
        elif not robot.last_state:
            sentence = f'waiting for states on {robot.state_topic}'
        elif age > STALE:
            sentence, fault = f'no state on {robot.state_topic} for {age:.0f} s', 'stale'
        else:
            sentence = self._said or ('paused' if self._paused else 'running')
        status = {'sentence': sentence, 'fault': bool(fault), 'paused': bool(self._paused), 'name': robot.name,
                  'can': sorted(self._offered() & {*CONTROLS}),
                  'values': {name: self._values[name] for name in SETTINGS if name in self._values}}
        if status != self.status:
            self.status = status


def _says_the_same(chain: Chain, described: Chain) -> bool:
    """Tell whether a chain has the joints and bodies that a URDF describes, as far as a URDF can."""
    if chain.joint_names != described.joint_names or not {*chain.body_index} <= {*described.body_index}:
        return False
    there = [described.body_index[body.name] for body in chain.bodies]
    position = np.linspace(0.3, 1.1, chain.joint_count)
    own, other = body_poses(chain, position), body_poses(described, position)
    # The carriage of a body that slides and turns has a small part of its mass.
    pairs: list = [(own.point, other.point[there], PLACES), (own.angle, other.angle[there], PLACES),
                   (own.center_of_mass, other.center_of_mass[there], MASSES)]
    pairs += [([body.mass, body.inertia], [described.bodies[index].mass, described.bodies[index].inertia], MASSES)
              for body, index in zip(chain.bodies, there)]
    return all(np.allclose(own, other, rtol=share, atol=share) for own, other, share in pairs)
