"""Which joints have a command for the state that lockstep has published last."""
from __future__ import annotations

from typing import Sequence

from .commands import Command


class Answers:
    """
    The answers to one state, given by its stamp; the next state waits for them.

    `joints`: indices of those that must have a command. A JointState answers the state whose stamp it
    repeats, a Float64MultiArray the outstanding state, unless the middleware received it before that was published.
    After a reset the state has the stamp of the one before; then this holds for a JointState too.
    The first answer counts. Joints that are not waited for take any command.
    """

    def __init__(self, joints: Sequence[int]):
        self._joints = frozenset(joints)
        self.missing = set()
        self.stamp, self.published, self.since = -1, 0, 0
        self._anew = False  # whether the state before had the same stamp
        self.reported = False  # whether silence has been reported

    def await_for(self, stamp: int, published: int, since: int) -> None:
        """
        Begin anew: wait for the answers to the state of this stamp, ns.

        It was published at `published`, ns since the epoch, by the clock that the middleware has, and at `since`, ns,
        by the steady one.
        """
        self._anew = stamp == self.stamp
        self.stamp, self.published, self.since, self.reported = stamp, published, since, False
        self.clear()

    def clear(self) -> None:
        """Forget the answers that have come, and wait for the same ones."""
        self.missing = set(self._joints)

    def note_repeated(self, published: int) -> None:
        """Note that the state was published once more: after a clock was set back, no answer must look old by that."""
        self.published = min(self.published, published)

    @property
    def complete(self) -> bool:
        """Whether every joint has its command."""
        return not self.missing

    def admit(self, command: Command, received: int) -> Command:
        """Return what acts of a command received at this time, ns since the epoch, or 0; and why the rest does not."""
        answers = command.stamp in (None, self.stamp)
        if command.stamp is None or self._anew:
            # DDS counts seconds in 32 bits, and has no later time
            answers = answers and (received <= 0 or received >= self.published)
        acting = [(joint, value) for joint, value in zip(command.joints, command.efforts)
                  if joint not in self._joints or (answers and joint in self.missing)]
        if len(acting) == len(command.joints):
            self.missing.difference_update(command.joints)
            return command
        joints, efforts = zip(*acting) if acting else ((), ())
        self.missing.difference_update(joints)
        return command._replace(joints=joints, efforts=efforts,
                                ignored=(*command.ignored, self._why(command, answers)))

    def _why(self, command: Command, answers: bool) -> tuple[str, str]:
        """Return why a command, or a part of it, is no answer to the state outstanding: reason, sentence."""
        if answers:
            return 'second answer', 'is for joints that already have a command for this state; the first one counts'
        if command.stamp in (None, self.stamp):
            return 'early answer', 'came before the state that waits for an answer was published'
        if not command.stamp:
            return 'no stamp', 'has no stamp, in lockstep it must repeat that of the state it answers'
        what = 'an earlier state' if command.stamp < self.stamp else 'no state that was published'
        return 'other stamp', (f'has the stamp {command.stamp * 1e-9:.9g} s, which is that of {what}: in lockstep it '
                               f'must repeat that of the state it answers, now {self.stamp * 1e-9:.9g} s')
