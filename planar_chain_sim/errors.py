"""Errors that a user can correct, each one sentence, and the class of the note about a robot file."""
from __future__ import annotations

from typing import Any, Optional


class Mistake(Exception):
    """An error that a user can correct, one sentence. Command lines write the sentence and exit with code 2."""


class ChainError(Mistake, ValueError):
    """An impossible chain: one sentence that says what is wrong, where, what was given and what is wanted."""


class LogError(Mistake):
    """A log that cannot be written or read: one sentence that names the file and the reason."""


class SimulationError(Mistake, RuntimeError):
    """
    A motion that cannot go on: one sentence, and where it stopped.

    `time` s, `tick`, `joint` and `body` (names), `position` and `velocity` (joints,): the last good state.
    `time` and `tick` are None where there is no simulation. `reason`: 'singular', a configuration without inertia;
    'not_finite', the state ran away; 'coarse' and 'too_long', the fixed step is too long; 'stalled', the steps have
    become too short; 'endless_events', events of stops and friction follow one another without end.
    """

    def __init__(self, message: str, *, joint: Optional[str] = None, body: Optional[str] = None,
                 time: Optional[float] = None, tick: Any = None, position: Any = None, velocity: Any = None,
                 reason: Optional[str] = None) -> None:
        super().__init__(message)
        self.reason = reason
        self.joint, self.body, self.time, self.tick = joint, body, time, tick
        self.position, self.velocity = position, velocity

    @property
    def ran_away(self) -> bool:
        """Whether the state diverged; else something else ended the motion."""
        return self.reason in ('not_finite', 'coarse')


class RobotFileNote(UserWarning):
    """One line about a robot file that was read: joints, plane, gravity, and what is not used."""
