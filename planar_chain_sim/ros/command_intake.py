"""Commands and other changes from the network: received when a tick needs them, recorded, checked and kept."""
from __future__ import annotations

from collections import Counter
from operator import itemgetter
from typing import Optional

from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

from .answers import Answers
from .commands import CommandError, CommandReader, HeldEffort, LONGEST_MESSAGE, too_long
from .messages import COMMANDS, INPUTS
from .._kernel import plain_command
from ..recording.cdr import CdrError
from ..recording.message_types import MESSAGE_TYPES


class CommandIntake:
    """
    Takes the messages of `inputs`, key of INPUTS -> polled subscription, for the joints and bodies of `chain`.

    `context`: of rclpy. `publication` records messages and publishes events; `warn(key, sentence)` logs a warning and
    returns True, or returns False if it has logged one for this key in the last second.
    `commanded`: of CommandReader. held: HeldEffort. rejected, ignored: reason -> number of messages that were
    refused, and of those without effect, in whole or in part. superseded: number of messages replaced by newer ones
    before they acted. fresh: topics of accepted messages, until the owner clears it. changes: (kind, what) of a Change
    -> key of its input and its data, the newest, until the owner takes it out.
    """

    def __init__(self, chain, commanded, inputs, context, publication, warn):
        self._names, self._inputs, self._publication, self._warn = chain.joint_names, inputs, publication, warn
        self._topics = {key: subscription.topic_name for key, subscription in inputs.items()}
        # Bound once: subscriptions outlive the thread that takes from them, and it does so at every tick.
        self._takes = {key: (subscription.handle.take_message, subscription.msg_type,
                             range(max(subscription.qos_profile.depth, INPUTS[key].depth)))
                       for key, subscription in inputs.items()}
        self._reader = CommandReader(self._names, commanded)
        # Inputs that are no commands: key -> what decodes a message, and what makes a Change of it.
        self._readers: dict[str, tuple] = {key: (MESSAGE_TYPES[topic.type_name].decode, topic.reader(chain).read)
                                           for key, topic in INPUTS.items() if topic.reader}
        self.held, self.rejected, self.ignored = HeldEffort(len(self._names)), Counter(), Counter()
        self.superseded, self.fresh = 0, set()
        self.changes, self._unread = {}, []  # _unread: messages on inputs that are no commands
        self._heard: tuple[str, ...] = ()  # keys of the inputs that have a publisher
        self._next: tuple[str, ...] = ()   # keys of the inputs to poll next time
        self._waker = GuardCondition(lambda: None, None, context=context)
        self._wait_set = _rclpy.WaitSet(len(inputs), 1, 0, 0, 0, 0, context.handle)

    def check_publishers(self) -> None:
        """Find out which inputs have a publisher."""
        self._heard = tuple(key for key, subscription in self._inputs.items() if subscription.get_publisher_count())
        self._next = tuple(INPUTS)  # a publisher may have come and gone since the last call

    @property
    def commanded(self) -> bool:
        """Whether there was a publisher of commands at the last check_publishers()."""
        return any(key in COMMANDS for key in self._heard)

    def wait(self, nanoseconds: int) -> None:
        """Sleep until a command comes or wake() is called, but no longer than this."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for subscription in self._inputs.values():
            wait_set.add_subscription(subscription.handle)
        wait_set.add_guard_condition(self._waker.handle)
        wait_set.wait(nanoseconds)
        self._next = tuple(INPUTS)

    def wake(self) -> None:
        """End a wait(), from any thread."""
        self._waker.trigger()

    def close(self) -> None:
        """Free what wait() uses."""
        self._waker.destroy()

    def take_commands(self, tick: int, answers: Optional[Answers] = None) -> Optional[str]:
        """
        Take the messages that have come; return the topic of the newest command that acts from `tick` on.

        None if there is no such command, or if its event is recorded already. The newest command of each joint
        acts; in lockstep the first one that answers the waiting state.
        """
        arrived = self._take() if self._next else ()
        if self._unread:
            self._read_changes()
        if not arrived:
            return None
        if len(arrived) == 1 and not answers and arrived[0][1] == 'commands':
            event = plain_command(arrived[0][2], self.held.effort, tick, self._topics['commands'])
            if event:
                self.held.renew(tick)
                self.fresh.add(self._topics['commands'])
                self._publication.record_event(event)
                return None
        acting, rejected, settled = [], {}, set()
        for place, (received, key, data) in enumerate(arrived if answers else reversed(arrived)):
            if not answers and len(settled) == len(self._names):
                self.superseded += len(arrived) - place  # the rest of a flood need not be read
                break
            try:
                command = self._reader.read(INPUTS[key].type_name, data)
            except CommandError as error:
                rejected.setdefault(key, []).append(error)
                continue
            topic = self._topics[key]
            if answers:
                command = answers.admit(command, received)
            for reason, sentence in command.ignored:
                self.ignore(topic, reason, f'command on {topic} {sentence}')
            if command.joints:
                acting.append((topic, command))
                self.fresh.add(topic)
                self.superseded += not answers and settled.issuperset(command.joints)
                settled.update(command.joints)
        for key, errors in rejected.items():
            self.reject(key, errors)
        if not acting:
            return None
        for _, command in acting if answers else reversed(acting):
            self.held.hold(command, tick)
        return acting[-1 if answers else 0][0]

    def _take(self) -> list:
        """Return (time received, key, data) of the commands that have come, oldest first; record all messages."""
        keys, self._next = self._next, self._heard
        arrived = []
        for key in keys:
            take, message_type, depth = self._takes[key]
            for _ in depth:  # not until the queue is empty: a flood would never end
                taken = take(message_type, True)
                if taken is None:
                    break
                data, about = taken
                if key in COMMANDS:
                    arrived.append((about['received_timestamp'], key, data))
                else:
                    self._unread.append((key, data))
                if len(data) <= LONGEST_MESSAGE:
                    self._publication.record_command(self._topics[key], data, about['source_timestamp'])
        # Each topic keeps its own order; between topics, the time at which the middleware received a message decides.
        if len(keys) > 1:
            arrived.sort(key=itemgetter(0))
        return arrived

    def _read_changes(self) -> None:
        """Read the messages on other inputs that have come, and keep the newest change of each thing."""
        rejected = []
        for key, data in self._unread:
            decode, read = self._readers[key]
            try:
                if len(data) > LONGEST_MESSAGE:
                    raise too_long(data)
                kind, what, change, ignored = read(decode(data))
            except CdrError as error:
                rejected.append((key, CommandError('malformed', str(error))))
                continue
            except CommandError as error:
                rejected.append((key, error))
                continue
            topic, place = self._topics[key], (kind, what)
            for reason, sentence in ignored:
                self.ignore(topic, reason, f'{key} on {topic} {sentence}')
            self.superseded += place in self.changes
            self.changes[place] = key, change
            self.fresh.add(topic)
        self._unread.clear()
        for key in dict(rejected):
            self.reject(key, [error for place, error in reversed(rejected) if place == key])

    def ignore(self, topic: str, reason: str, sentence: str) -> None:
        """Count a message without effect; report it by at most one warning and one event a second."""
        self.ignored[reason] += 1
        if self._warn((topic, reason), sentence):
            self._publication.publish_event('ignored', topic=topic, reason=reason, message=sentence,
                                            count=self.ignored[reason])

    def reject(self, key: str, errors: list) -> None:
        """Count and report the messages refused on an input, `errors` newest first: one report for each reason."""
        topic, what = self._topics[key], 'command' if key in COMMANDS else key
        for reason, count in Counter(error.reason for error in errors).items():
            error = next(error for error in errors if error.reason == reason)
            self.rejected[reason] += count
            self._publication.publish_event('rejected', topic=topic, reason=str(error), count=count)
            self._warn((topic, reason), f'{what} on {topic} rejected: {error}')
