"""BagRun: the run of the node in a bag: its states by tick, and the changes between them, as far as the bag tells."""
from __future__ import annotations

from itertools import combinations
from typing import Any, Callable, Iterator, Optional

import numpy as np

from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state
from ..chain.section import clipped, counted
from ..chain_file import chain_from_text
from ..errors import LogError
from ..motion.simulation import Simulation
from ..recording.bag import Bag
from ..recording.cdr import CdrError, decode_joint_state, decode_string, JointStateMessage
from ..recording.events import decode_event, EVENTS
from ..recording.following import Following
from ..recording.message_types import MESSAGE_TYPES

STATE, STRING, WRENCH = 'sensor_msgs/msg/JointState', 'std_msgs/msg/String', 'geometry_msgs/msg/WrenchStamped'
BESIDE = {'events': STRING, 'wrench': WRENCH, 'commands': 'std_msgs/msg/Float64MultiArray', 'joint_commands': STATE}
FINE = 1e-3         # s, to which the times of commands are used where states are further apart
EVEN, UNEVEN = 0.1, 0.1   # stamps may be off by this share of the time between states; this share of them by more
STILL = 1e-12       # of the largest square of a velocity: no motion, which tells no time
JUMP = 0.2          # share of a motion that the velocity does not explain, at least, where a reset has set the state
FAR, MOST, LONG = 5, 200, 5   # states between two events that tell how many ticks that takes; events and pairs asked
SIMULATED = 10**17  # ns, three years: stamps below are simulated time, others are wall time
OTHER_PACE = 0.05   # relative: the pace of stamps and motion differs at least so much at another real_time_factor
AFTER_STATE = ('command', 'stop_touched', 'stop_left', 'stuck', 'slipped')   # events that come after the next state
WINDOW = 50         # states by which events may have come earlier or later than the states beside them


class BagRun(Following):
    """
    Follows a bag as Following does a log. `chain`: None takes that of robot_description in the bag.

    Ticks are counted from the first state. notes: sentences that say what was assumed. `settings`: method and tolerance
    for the simulation, which no bag tells. LogError: what the bag holds makes no run.
    """

    def __init__(self, bag: Bag, chain: Optional[Chain], method: str, tolerance: Optional[float],
                 told: Callable[[dict, Chain], object]):
        self._bag, self._told, self.notes = bag, told, []
        topics: dict[tuple, list] = {}   # (topic, type) -> [(received, bytes)]
        for message in bag.messages:
            if message.type_name in BESIDE.values():
                topics.setdefault(message[:2], []).append((message.log_time, message.data))
        chain = self._described(topics) if chain is None else chain
        topic = self._state_topic(topics, chain)
        self._read_states(topics.pop((topic, STATE)), chain)
        mine = self._beside(topics, topic)
        told = self._decoded_events(mine['events'])
        commands = np.array(sorted(received for name in ('commands', 'joint_commands') for received, _ in mine[name]))
        step = self._count_ticks(told, commands.size > 0)
        self._events = (self._told_changes(told, chain, step) if told else
                        self._seen_changes(mine['wrench'], commands, chain))
        self.simulation = Simulation(chain, method, step, tolerance)
        self.effort = np.zeros(chain.joint_count)
        try:
            self.simulation.set_state(self._position[0], self._velocity[0])
        except ValueError as error:
            raise self.error(f'its first state is impossible for the chain ({error})') from None

    def states(self) -> Iterator[tuple]:
        """Yield tick and number of each state, and apply the changes between them; LogError."""
        before, events, ticks = -1, iter(self._events), self._ticks.tolist()
        event, resets = next(events, None), {each['tick'] for each in self._events if each['kind'] == 'reset'}
        for k, tick in enumerate(ticks):
            # What comes at a tick comes after its first state, unless that is the one after a reset, as of a tick that
            # is published for this reason alone.
            alone = tick in resets and self._initial[k]
            limit = tick + 1 if tick == before or alone else tick
            while event is not None and event['tick'] < limit:
                try:
                    self._change(event, event['tick'])
                except ValueError as error:
                    raise self.error(f"its {event['kind']} at tick {event['tick']} cannot be used ({error})") from None
                event = next(events, None)
            before = tick
            yield tick, k

    def decode(self, message: Any) -> JointStateMessage:
        """Return the state of a number, in the joint order of the chain."""
        return JointStateMessage(int(self._stamps[message]), '', self.simulation.chain.joint_names,
                                 self._position[message], self._velocity[message], self._effort[message])

    def error(self, why: str) -> LogError:
        """Return the LogError with this reason."""
        return LogError(f'bag {str(self._bag.path)!r}: {why}')

    def _described(self, topics: dict) -> Chain:
        """Return the chain of robot_description."""
        for (topic, kind), messages in topics.items():
            if kind == STRING and _last(topic) == 'robot_description':
                try:
                    chain = chain_from_text(decode_string(messages[0][1]), f'{self._bag.path}: {topic}')
                except CdrError as error:
                    raise self.error(f'{topic} cannot be read ({error})') from None
                self.notes.append(f'The chain is the URDF on {topic}, which lacks what URDF cannot describe, springs '
                                  'and rotors among it; --chain gives the chain file.')
                return chain
        raise self.error('it holds no robot_description, so give its chain file with --chain')

    def _state_topic(self, topics: dict, chain: Chain) -> str:
        """Return the topic of the states that have the joints of the chain."""
        found = {}
        for (topic, kind), messages in topics.items():
            if kind == STATE and _last(topic) != 'joint_commands':
                found[topic] = self._decoded(topic, messages[0][1]).names
        right = [topic for topic, names in found.items() if sorted(names) == sorted(chain.joint_names)]
        right = [topic for topic in right if _last(topic) == 'joint_states'] or right
        if len(right) == 1:
            return right[0]
        if right:
            raise self.error(f'it holds states of these joints on {", ".join(sorted(right))}, must hold them on one '
                             'topic')
        names = '; '.join(f'{topic} has {clipped(", ".join(names), 200)}' for topic, names in found.items())
        raise self.error(f'it holds no states of the joints {clipped(", ".join(chain.joint_names), 200)}'
                         + (f' ({names})' if names else ''))

    @staticmethod
    def _beside(topics: dict, state_topic: str) -> dict:
        """Return the messages on the node's other topics, which are in the same namespace, in the order of coming."""
        space = state_topic.rpartition('/')[0]
        found: dict[str, list] = {name: [] for name in BESIDE}
        for (topic, kind), messages in topics.items():
            name = _last(topic)
            if BESIDE.get(name) == kind and topic.startswith(f'{space}/') and not found[name]:
                found[name] = sorted(messages, key=lambda message: message[0])
        return found

    def _decoded(self, topic: str, data: bytes):
        try:
            return decode_joint_state(data)
        except CdrError as error:
            raise self.error(f'a message on {topic} cannot be used ({error})') from None

    def _read_states(self, messages: list, chain: Chain) -> None:
        """Read all states, in the order in which they came, with the joints in the order of the chain."""
        messages.sort(key=lambda message: message[0])
        rows, stamps = [], []
        names: tuple = ()
        order: list[int] = []
        for _, data in messages:
            state = self._decoded('its topic of states', data)
            if state.names != names:
                if sorted(state.names) != sorted(chain.joint_names):
                    raise self.error('the joints of its states are not always the same')
                names, order = state.names, [state.names.index(name) for name in chain.joint_names]
            effort = state.effort if state.effort.size else np.full(len(names), np.nan)
            if not state.position.size == state.velocity.size == effort.size == len(names):
                raise self.error('a state lacks positions or velocities')
            rows.append((state.position[order], state.velocity[order], effort[order]))
            stamps.append(state.stamp)
        numbers = np.array(rows)
        if not np.isfinite(numbers[:, :2]).all():
            raise self.error('a state has a position or velocity that is not finite')
        self._order = order   # of the node's joints in the chain
        self._received, self._stamps = np.array([time for time, _ in messages]), np.array(stamps)
        self._position, self._velocity, self._effort = numbers.swapaxes(0, 1)
        same = np.append(False, (np.diff(self._stamps) == 0) & (numbers[1:] == numbers[:-1]).all(axis=(1, 2)))
        self._keep(~same)   # the state of a pause, once more
        self._initial = (np.stack((self._position, self._velocity), axis=1) == initial_state(chain)).all(axis=(1, 2))

    def _keep(self, kept: np.ndarray) -> None:
        for name in ('_received', '_stamps', '_position', '_velocity', '_effort'):
            setattr(self, name, getattr(self, name)[kept])

    def _count_ticks(self, told: list, commanded: bool) -> float:
        """Give each state the node's tick, counted from the first state; return the time between two ticks, s."""
        gaps = np.diff(self._stamps)
        if not (gaps > 0).any():
            raise self.error('it holds fewer than two states with different stamps')
        if (gaps < 0).any():
            raise self.error('the stamps of its states go back, as when the node was started again; must be one run')
        usual = float(np.median(gaps[gaps > 0]))
        states = np.rint(gaps / usual)
        even = np.abs(gaps / usual - states) < EVEN
        if np.count_nonzero(~even) > max(UNEVEN * len(gaps), 10) and not self._simulated:
            raise self.error('the stamps of its states are not evenly spaced, as with a real_time_factor of 0; '
                             'publish_clock gives the states their simulated time')
        spacing = float(gaps[np.abs(gaps / usual - 1.0) < 0.01].mean()) * 1e-9
        moved, speed = np.diff(self._position, axis=0), (self._velocity[1:] + self._velocity[:-1]) / 2.0
        square = (speed**2).sum(axis=1)
        moving = square > STILL * square.max()
        took = np.where(moving, (moved * speed).sum(axis=1) / np.where(moving, square, 1.0), np.nan)   # s, simulated
        jumped = self._initial[1:] | (
            np.abs(moved - speed * took[:, None]).sum(axis=1) > JUMP * np.abs(moved).sum(axis=1))
        pace = 1.0 if self._simulated else self._pace(took[(states == 1) & even], spacing)
        place, breaks = (np.append(0.0, np.cumsum(each)) for each in (states, ~even))
        apart = self._apart(told, place, breaks, spacing) if told or not commanded else max(
            1, round(pace * spacing / FINE))
        step = pace * spacing / apart
        rate = round(1.0 / step)
        if rate and abs(step * rate - 1.0) < 1e-5:   # stamps are whole ns
            step = 1.0 / rate
        most = np.rint(gaps * (1e-9 * pace / step))
        ticks = most if self._simulated else np.where(even, states * apart, np.maximum(most, 1.0))
        # After a pause, or time that the node dropped, the arm has moved for less time than the stamps say.
        late = (gaps > 0) & ((states > 1) | ~even) & ~jumped & (not self._simulated)
        near = np.abs(took - step * most) <= step * np.maximum(1.0, EVEN * most)
        less = late & ~near & (~even | (np.abs(took - step * apart) < np.abs(took - step * most)))
        ticks[less] = np.clip(np.rint(np.where(moving, took, 0.0)[less] / step), 1.0, ticks[less])
        self._ticks = np.append(0, np.cumsum(ticks.astype(np.int64)))
        if less.any():
            self.notes.append(f'Time stood still {counted(int(less.sum()), "time")}: stamps went on, joints did not.')
        lost = int(np.maximum(states - 1, 0)[~less].sum())
        if lost:
            self.notes.append(f'Missing: {counted(lost, "state")}.')
        return step

    @property
    def _simulated(self) -> bool:
        """Whether stamps are simulated time, and no wall time."""
        return bool(self._stamps[-1] < SIMULATED)

    def _beside_states(self, told: list, values: np.ndarray) -> list:
        """Return events and the value at their time, where `values` has one for each state; all if none is inside."""
        inside = [each for each in told if self._received[0] <= each[1] <= self._received[-1]] or told
        return [(event, float(np.interp(time, self._received, values))) for event, time in inside]

    def _apart(self, told: list, place: np.ndarray, breaks: np.ndarray, spacing: float) -> int:
        """
        Return the node's ticks from one state to the next, 1 where there are no events to tell it.

        place: where states are, as multiples of `spacing`, s; breaks: how many gaps before them are no such multiple.
        """
        if self._simulated:
            ratios = [event['tick'] * spacing * 1e9 / stamp
                      for event, stamp in self._beside_states(told, self._stamps) if stamp > 0]
        else:
            seen = [(event['tick'], here, np.interp(here, place, breaks))
                    for event, here in self._beside_states(told, place)][:MOST]
            pairs = [(there - here, tick - before) for (before, here, part), (tick, there, same)
                     in combinations(seen, 2) if there - here >= FAR and part == same]
            ratios = [ticks / states for states, ticks in sorted(pairs)[-LONG:]]
        return max(1, round(float(np.median(ratios)))) if ratios else 1

    def _pace(self, took: np.ndarray, spacing: float) -> float:
        """Return the simulated time per time of stamps, 1 unless positions and velocities say otherwise."""
        took = took[np.isfinite(took)]
        pace = float(np.median(took)) / spacing if took.size else 1.0
        if pace <= 0.0 or abs(pace - 1.0) < OTHER_PACE:
            return 1.0
        pace = float(f'{pace:.3g}')
        self.notes.append(f'Positions and velocities say that the node ran at a real_time_factor of {pace:g}.')
        return pace

    def _decoded_events(self, messages: list) -> list:
        """Return the events and the times, ns, at which they came, in that order."""
        told = []
        for received, data in messages:
            try:
                event = decode_event(data)
            except ValueError as error:
                raise self.error(f'one of its events cannot be read ({error})') from None
            told.append((event, received))
        return told

    def _told_changes(self, told: list, chain: Chain, step: float) -> list:
        """Return the events that change the run, at ticks from the first state on."""
        if self._simulated:
            shift = -round(int(self._stamps[0]) * 1e-9 / step)
        else:
            shift = self._shift(told, chain)
        events, begin = [], -shift
        for event, _ in told:
            if event['kind'] in EVENTS and EVENTS[event['kind']].changes_run:
                if event['tick'] < begin and event['kind'] in ('reset', 'state'):
                    events = [each for each in events if each['kind'] in ('parameter', 'payload')]
                    continue
                events.append({**event, 'tick': max(event['tick'] + shift, 0), 'data': self._in_order(event['data'])})
        if not any(each['tick'] == 0 and each['data'].get('effort') is not None for each in events):
            events = [*self._first_effort(), *events]
        self.notes.append('Commands and other changes act at the ticks that the events of the node name'
                          + (f'; the bag begins at tick {begin}.' if begin > 0 else '.'))
        return events

    def _shift(self, told: list, chain: Chain) -> int:
        """Return what to add to the ticks of events: where most commands show in the efforts of the states."""
        around = round(float(np.median([tick - event['tick'] - (event['kind'] in AFTER_STATE)
                                        for event, tick in self._beside_states(told, self._ticks)])))
        commands = [event for event, _ in told if event['kind'] == 'command']
        resets = np.array([event['tick'] for event, _ in told if event['kind'] == 'reset'])
        if not commands or np.isnan(self._effort).any():
            return around
        limit = np.array([joint.effort_limit for joint in chain.joints])
        asked = np.array([event['tick'] for event in commands])
        efforts = np.clip([self._in_order(event['data'])['effort'] for event in commands], -limit, limit)
        reach = WINDOW * round(float(np.median(np.diff(self._ticks))) or 1)
        best = (0, 0, around)
        for shift in range(around - reach, around + reach + 1):
            after = np.searchsorted(self._ticks, asked + shift, 'right')   # the first state behind its tick
            inside = (after > 0) & (after < len(self._ticks))
            after, wanted = after[inside], efforts[inside]
            shown = (self._effort[after] == wanted).all(axis=1) & (self._effort[after - 1] != wanted).any(axis=1)
            seen = int(shown.sum()) + np.isin(resets + shift, self._ticks[self._initial]).sum()
            best = max(best, (seen, -abs(shift - around), shift))
        return best[2]

    def _in_order(self, data: dict) -> dict:
        """Return the data of an event with its lists of joints in the order of the chain."""
        sorted_data = dict(data)
        for key in ('effort', 'value', 'position', 'velocity'):
            values = data.get(key)
            if isinstance(values, list) and len(values) == len(self._order) and data.get('name') != 'gravity':
                sorted_data[key] = [values[k] for k in self._order]
        return sorted_data

    def _seen_changes(self, wrenches: list, commands: np.ndarray, chain: Chain) -> list:
        """Return the changes without events: efforts and jumps of the states, at times of commands; wrenches."""
        events, effort = self._first_effort(), self._effort
        for k in range(1, len(self._ticks)):
            tick, before, state = int(self._ticks[k]), int(self._ticks[k - 1]), (self._position[k], self._velocity[k])
            if tick == before:
                data = dict(zip(('position', 'velocity'), np.array(state).tolist()))
                events.append({'tick': tick, 'kind': 'reset', 'data': {}} if self._initial[k] else {
                    'tick': tick, 'kind': 'state', 'data': data})
            elif k > 1 and ((effort[k] != effort[k - 1]).any() or before == self._ticks[k - 2]) and (
                    np.isfinite(effort[k]).all()):
                start, end = self._received[k - 1:k + 1].tolist()
                came = commands[(commands > start) & (commands <= end)]
                share = (came[-1] - start) / (end - start) if came.size else 0.0
                events.append({'tick': before + min(int(share * (tick - before)), tick - before - 1),
                               'kind': 'command', 'data': {'effort': effort[k].tolist()}})
        decode = MESSAGE_TYPES[WRENCH].decode
        assert decode is not None
        for received, data in wrenches:
            try:
                wrench = decode(data)
            except CdrError as error:
                raise self.error(f'a wrench cannot be used ({error})') from None
            if wrench['body'] not in chain.body_index or not np.isfinite(wrench['force'] + wrench['torque']).all():
                continue   # the node refused it
            k = self._before(received)
            events.append({'tick': int(self._ticks[k]), 'kind': 'wrench', 'data': {
                'body': wrench['body'], 'force': list(wrench['force'][:2]), 'moment': wrench['torque'][2],
                'axes': 'body'}})
        self.notes.append('The bag has no events of the node: efforts and resets are those that the states show'
                          + (', at the times of commands' if commands.size else '')
                          + ('; wrenches act from the last state before them on.' if wrenches else '.'))
        return sorted(events, key=lambda event: event['tick'])

    def _before(self, received: int) -> int:
        """Return the number of the last state that came before a time, ns; 0 where there is none."""
        return max(int(np.searchsorted(self._received, received, 'right')) - 1, 0)

    def _first_effort(self) -> list:
        """Return the event of the effort that acts from the first state on."""
        if len(self._effort) < 2 or not np.isfinite(self._effort[1]).all():
            return []
        return [{'tick': 0, 'kind': 'command', 'data': {'effort': self._effort[1].tolist()}}]


def _last(topic: str) -> str:
    return topic.rpartition('/')[2]
