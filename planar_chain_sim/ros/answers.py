"""Which joints have a command for the state that lockstep has published last."""
from __future__ import annotations

from typing import Sequence

from .commands import Command


class Answers:
    """
    The answers to one state, given by its stamp; the next state waits for them.

    `joints`: indices of those that must have a command. A JointState answers the state whose stamp it repeats. A
    Float64MultiArray answers the waiting state, unless the middleware received it before that state was published.
    After a reset two states have the same stamp, so a JointState must then have come after the second one, too.
    The first answer counts. All other joints take any command.
    """

    def __init__(self, joints: Sequence[int]):
        self._joints = frozenset(joints)
        self.missing = set()
        self.stamp, self.published, self.since = -1, 0, 0
        self._same_stamp = False  # whether the state before had the same stamp
        self.reported = False  # whether silence has been reported

    def await_for(self, stamp: int, published: int, since: int) -> None:
        """
        Wait for the answers to the state of this stamp, ns.

        `published`: ns since the epoch, when it was published by the clock of the middleware. `since`: ns, the same by
        the steady clock.
        """
        self._same_stamp = stamp == self.stamp
        self.stamp, self.published, self.since, self.reported = stamp, published, since, False
        self.clear()

    def clear(self) -> None:
        """Discard the answers that have come, and wait for them again."""
        self.missing = set(self._joints)

    def note_repeated(self, published: int) -> None:
        """Note that the state was published again: if the clock was set back, answers must not look too old."""
        self.published = min(self.published, published)

    @property
    def complete(self) -> bool:
        """Whether every joint has its command."""
        return not self.missing

    def admit(self, command: Command, received: int) -> Command:
        """Return the part of a command that acts, and why the rest does not; `received`: ns since the epoch, or 0."""
        answers = command.stamp in (None, self.stamp)
        if command.stamp is None or self._same_stamp:
            # DDS counts seconds in 32 bits and has no time for what comes later
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
        """Return why a command, or a part of it, is no answer to the waiting state: reason, sentence."""
        if answers:
            return 'second answer', 'is for joints that already have a command for this state; the first one counts'
        if command.stamp in (None, self.stamp):
            return 'early answer', 'came before the state that waits for an answer was published'
        if not command.stamp:
            return 'no stamp', 'has no stamp, in lockstep it must repeat that of the state it answers'
        what = 'an earlier state' if command.stamp < self.stamp else 'no state that was published'
        return 'other stamp', (f'has the stamp {command.stamp * 1e-9:.9g} s, which is that of {what}: in lockstep it '
                               f'must repeat that of the state it answers, now {self.stamp * 1e-9:.9g} s')
