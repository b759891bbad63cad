"""Which joints have a command for the state that lockstep has shown last."""
from __future__ import annotations

from typing import Optional, Sequence

from .commands import Command


class Answers:
    """
    The answers to one state, of its stamp, which the next state waits for.

    `joints`: indices of those that must have a command. A JointState answers the state whose stamp it echoes, a
    Float64MultiArray the one outstanding, unless the middleware received it before that was shown. The first answer
    stands. Joints that nobody waits for take any command.
    """

    def __init__(self, joints: Sequence[int]):
        self._joints = frozenset(joints)
        self.missing = set()
        self.stamp = self.shown = self.since = 0
        self.told = False  # whether silence has been reported
        self.ignored = 0   # commands that answered nothing, since the start

    def await_for(self, stamp: int, shown: int, since: int) -> None:
        """
        Begin anew: wait for the answers to the state of this stamp, ns.

        It was shown at `shown`, ns since the epoch, by the clock that the middleware has, and at `since`, ns, by the
        steady one.
        """
        self.stamp, self.shown, self.since, self.told = stamp, shown, since, False
        self.clear()

    def clear(self) -> None:
        """Forget the answers that have come, and wait for the same ones."""
        self.missing = set(self._joints)

    def again(self, shown: int) -> None:
        """Show the state once more: a clock that was set back meanwhile must not make all answers look old."""
        self.shown = min(self.shown, shown)

    @property
    def complete(self) -> bool:
        """Whether every joint has its command."""
        return not self.missing

    def admit(self, command: Command, received: int) -> Optional[Command]:
        """Return what acts of a command that came at `received`, ns since the epoch, or 0; None where nothing."""
        if command.stamp is None:
            answers = not received or received >= self.shown
        else:
            answers = command.stamp == self.stamp
        acting = [(joint, value) for joint, value in zip(command.joints, command.efforts)
                  if joint not in self._joints or (answers and joint in self.missing)]
        if not acting:
            self.ignored += bool(command.joints)
            return None
        joints, efforts = zip(*acting)
        self.missing.difference_update(joints)
        return command._replace(joints=joints, efforts=efforts)
