"""
Lockstep over plain topics: a state is published, and only when its commands are there does the next come about.

Nothing of it depends on the clock, so that a controller of any slowness gives the same bits.
"""
from __future__ import annotations

from time import monotonic_ns, time_ns

from .answers import Answers
from .simulator import Simulator
from .tick_thread import LONGEST_SLEEP

USUAL_TIMEOUT = 1.0  # s; where command_timeout is not set, silence is reported after this
REPEAT_PERIOD = 1_000_000_000  # ns after which the state outstanding is published again, for those who came late


class LockstepSimulator(Simulator):
    """A Simulator whose wake-up is the arrival of the last command that the state outstanding waits for."""

    def __init__(self, simulation, values, *arguments):
        super().__init__(simulation, values, *arguments)
        self._answers = Answers(list(map(simulation.chain.joint_names.index, values['lockstep_joints'])))
        self._topic = None  # of the newest answer that is not recorded
        self._seen = False  # whether anybody may have got the state outstanding

    def _wait_or_tick(self, now: int) -> None:
        """Make the ticks of a period where all commands are there, else wait for one more."""
        self._take_commands()
        if self._answers.complete:
            while self._tick() and self._simulation.tick % self._publication.ticks_per_state:
                pass
            return
        if now >= self._repeat_due or not self._seen and self._publication.has_listeners():
            self._publish_state(record=False)
        self._report_silence(now)
        self._intake.wait(LONGEST_SLEEP)

    def _report_silence(self, now: int) -> None:
        """Report, once for a state, that commands have not come in time."""
        answers, timeout = self._answers, self._values['command_timeout'] or USUAL_TIMEOUT
        waited = (now - answers.since) * 1e-9
        if waited < timeout or answers.reported:
            return
        answers.reported = True
        names, _ = self._waiting_for()
        self._publication.publish_event('command_timeout', joints=list(names), seconds=waited, effort=None)
        self._logger.warning(f'lockstep waits at tick {self._simulation.tick}: no command for '
                             f'{", ".join(names[:32])} within {waited:.3g} s')

    def _waiting_for(self) -> tuple:
        names = self._simulation.chain.joint_names
        return (tuple(names[joint] for joint in sorted(self._answers.missing)),
                (monotonic_ns() - self._answers.since) * 1e-9)

    def _publish_state(self, record: bool, publish: bool = True) -> None:
        """Publish the state; where it is a new one, wait for its answers from now on."""
        now, wall = monotonic_ns(), time_ns()  # before it is out: an answer may be here before this thread goes on
        super()._publish_state(record, publish)
        if publish:
            self._repeat_due, self._seen = now + REPEAT_PERIOD, self._publication.has_listeners()
            if record:
                self._answers.await_for(self._pacing.stamp(self._simulation.tick), wall, now)
            else:
                self._answers.note_repeated(wall)

    def _take_commands(self) -> None:
        """Take the answers that have come, and record which efforts act when all are there."""
        self._topic = self._intake.take_commands(self._simulation.tick, self._answers) or self._topic
        self._apply_wrenches()
        if self._topic and self._answers.complete:
            self._record_command(self._topic)
            self._topic = None

    def _clear_commands(self) -> None:
        """Forget answers too: those of a controller that has gone must not be mixed with another's."""
        super()._clear_commands()
        self._answers.clear()
