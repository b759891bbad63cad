"""
Lockstep over plain topics: the node publishes a state and makes the next one only when it has all commands for it.

Nothing here depends on the clock, so a slow controller gives the same bits as a fast one.
"""
from __future__ import annotations

from time import monotonic_ns, time_ns

from .answers import Answers
from .simulator import Simulator
from .tick_thread import LONGEST_SLEEP

USUAL_TIMEOUT = 1.0  # s; without command_timeout, missing commands are reported after this time
REPEAT_PERIOD = 1_000_000_000  # ns after which the waiting state is published again, for new subscribers


class LockstepSimulator(Simulator):
    """A Simulator that advances when all commands for the waiting state have come."""

    def __init__(self, simulation, values, *arguments):
        super().__init__(simulation, values, *arguments)
        self._answers = Answers(list(map(simulation.chain.joint_names.index, values['lockstep_joints'])))
        self._topic = None  # of the newest answer that is not recorded
        self._seen = False  # whether the waiting state had a subscriber when it was published

    def _wait_or_tick(self, now: int) -> None:
        """Make the ticks of a period if all commands are there, else wait for one more command."""
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
        """Publish the state; if it is a new one, wait for its answers from now on."""
        now, wall = monotonic_ns(), time_ns()  # read before publishing, as an answer may come at once
        super()._publish_state(record, publish)
        if publish:
            self._repeat_due, self._seen = now + REPEAT_PERIOD, self._publication.has_listeners()
            if record:
                self._answers.await_for(self._pacing.stamp(self._simulation.tick), wall, now)
            else:
                self._answers.note_repeated(wall)

    def _take_commands(self) -> None:
        """Take the answers that have come; when all are there, record the efforts that act."""
        self._topic = self._intake.take_commands(self._simulation.tick, self._answers) or self._topic
        self._apply_changes()
        if self._answers.complete:
            self._record_answers()

    def _tick(self, publish: bool = False) -> bool:
        """Advance one tick, by ~/step also with a part of the answers."""
        self._record_answers()
        return super()._tick(publish)

    def _record_answers(self) -> None:
        if self._topic:
            self._record_command(self._topic)
            self._topic = None

    def _clear_commands(self) -> None:
        """Clear the answers too: those of a controller that has gone must not be mixed with another's."""
        super()._clear_commands()
        self._answers.clear()
