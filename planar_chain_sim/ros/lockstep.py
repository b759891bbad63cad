"""
Lockstep over plain topics: a state is published, and only when its commands are there does the next come about.

Nothing of it depends on the clock, so that a controller of any slowness gives the same bits.
"""
from __future__ import annotations

from time import monotonic_ns, time_ns

from .answers import Answers
from .simulator import LONGEST_SLEEP, Simulator

USUAL_TIMEOUT = 1.0  # s; where command_timeout is not set, silence is told after this
REPEAT_PERIOD = 1_000_000_000  # ns after which the state outstanding is shown again, for those who came late


class LockstepSimulator(Simulator):
    """A Simulator whose wake-up is the arrival of the last command that the state outstanding waits for."""

    def __init__(self, simulation, values, *arguments):
        super().__init__(simulation, values, *arguments)
        self._answers = Answers(list(map(simulation.chain.joint_names.index, values['lockstep_joints'])))
        self._topic = None  # of the newest answer
        self._seen = False  # whether anybody may have got the state outstanding

    def _go_on(self, now: int) -> None:
        """Make the ticks of a period where all commands are there, else wait for one more."""
        self._latch()
        if self._answers.complete:
            while self._tick() and self._simulation.tick % self._publication.ticks_per_state:
                pass
            return
        if now >= self._repeat_due or not self._seen and self._publication.has_listeners():
            self._show(record=False)
        self._report_silence(now)
        self._intake.wait(LONGEST_SLEEP)

    def _report_silence(self, now: int) -> None:
        """Tell, once for a state, that commands have not come in time."""
        answers, timeout = self._answers, self._values['command_timeout'] or USUAL_TIMEOUT
        waited = (now - answers.since) * 1e-9
        if waited < timeout or answers.told:
            return
        answers.told = True
        names, _ = self._waiting_for()
        self._publication.publish_event('command_timeout', joints=list(names), seconds=waited, effort=None)
        self._logger.warning(f'lockstep waits at tick {self._simulation.tick}: no command for '
                             f'{", ".join(names[:32])} within {waited:.3g} s')

    def _waiting_for(self) -> tuple:
        names = self._simulation.chain.joint_names
        return (tuple(names[joint] for joint in sorted(self._answers.missing)),
                (monotonic_ns() - self._answers.since) * 1e-9)

    def _show(self, record: bool, publish: bool = True) -> None:
        """Show the laid out state; where it is a new one, wait for its answers from now on."""
        now, wall = monotonic_ns(), time_ns()  # before it is out: an answer may be here before this thread goes on
        super()._show(record, publish)
        if publish:
            self._repeat_due, self._seen = now + REPEAT_PERIOD, self._publication.has_listeners()
            if record:
                self._answers.await_for(self._pacing.stamp(self._simulation.tick), wall, now)
            else:
                self._answers.again(wall)

    def _latch(self) -> None:
        """Take the answers that have come, and tell which efforts act when all are there."""
        self._topic = self._intake.latch(self._simulation.tick, self._answers) or self._topic
        self._push()
        if self._topic and self._answers.complete:
            self._tell_command(self._topic)
            self._topic = None

    def _clear_commands(self) -> None:
        """Forget answers too: what a controller that has gone said last is not to be mixed with another's."""
        super()._clear_commands()
        self._answers.clear()
