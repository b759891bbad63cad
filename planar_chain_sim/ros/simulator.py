"""The requests that other threads may make: each acts between two ticks and is an event with its tick."""
from __future__ import annotations

from time import monotonic_ns

from .requests import between_ticks
from .tick_thread import payload_of, TickThread
from ..chain.quantities import QUANTITIES, to_json
from ..errors import ChainError
from ..recording.events import apply_event

MEASURE_TIMEOUT = 0.5  # s: other requests must not wait behind diagnostics
STEP_SLICE = 20_000_000  # ns of steps before other requests get their turn


class Simulator(TickThread):
    """
    A TickThread with its requests, for any thread.

    Each returns (success, sentence or result). If a tick takes longer than ANSWER_TIMEOUT, the answer says so; the
    work is done after that tick, but set_parameters, measure and ignore are withdrawn.
    overruled: number of pauses, resumes and resets; each of them ends stepping that is under way.
    """

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.overruled = 0

    @between_ticks(withdraw=True)
    def ignore(self, topic: str, reason: str, sentence: str) -> tuple[bool, str]:
        """Report that something on a topic has no effect."""
        self._intake.ignore(topic, reason, sentence)
        return True, sentence

    @between_ticks
    def reset(self) -> tuple[bool, str]:
        """Restore the initial state and clear efforts and wrenches; time goes on."""
        self.overruled += 1
        apply_event(self._simulation, 'reset', {})
        self._clear_commands()
        self._acting.clear()
        self._meter.balance.release()
        if self._end and not self._paused:
            self._pacing.anchor(self._simulation.tick, monotonic_ns())
        self._end = None
        self._publication.publish_event('reset')
        self._publication.copy_state_into_message()
        self._meter.restart(self._simulation)
        self._publish_state(record=True)
        return True, f'initial state and zero efforts from tick {self._simulation.tick} on'

    @between_ticks
    def step(self) -> tuple[bool, str]:
        """Make one tick, only while paused."""
        done, result = self.step_on(1, self.overruled)
        return done, f'stepped to tick {self._simulation.tick}' if done else str(result)

    @between_ticks
    def step_on(self, ticks: int, overruled: int) -> tuple[bool, object]:
        """Make at most `ticks` ticks and return their number; `overruled`: its value at the first of several calls."""
        if self._end:
            return False, f'not stepped: {self._end}'
        if not self._paused:
            return False, 'not stepped: the simulation is running, pause it first'
        if overruled != self.overruled:
            return False, 'stepped no further: ~/pause or ~/reset came between'
        self._check_log()
        self._check_publishers()
        done, until = 0, monotonic_ns() + STEP_SLICE
        while done < ticks and (not done or monotonic_ns() < until) and not self._stopping:
            self._take_commands()
            self._publication.publish_event('step')
            if not self._tick(publish=True):
                return False, str(self._end)
            done += 1
        return True, done

    @between_ticks
    def pause(self, wanted: bool, reset: bool = False) -> tuple[bool, str]:
        """Pause or resume, and reset if wanted."""
        self.overruled += 1
        state, tick = 'paused' if wanted else 'running', self._simulation.tick
        sentence = f'already {state} at tick {tick}'
        if wanted != self._paused:
            self._paused, sentence = wanted, f'{state} from tick {tick} on'
            if not wanted:
                self._pacing.anchor(tick, monotonic_ns())
            self._publication.publish_event('pause' if wanted else 'resume')
        if reset:
            self.reset()
        return True, sentence

    @between_ticks(withdraw=True)   # so that a parameter reads as it acts
    def set_parameters(self, values: dict) -> tuple[bool, str]:
        """Set all values from this tick on, or none of them if one is impossible."""
        simulation, changes = self._simulation, []
        moving = [name for name in values if name in QUANTITIES or name == 'payload_mass']
        before = simulation.checkpoint() if moving else None
        for name, value in values.items():
            kind, data = 'parameter', {'name': name, 'value': to_json(value) if name in QUANTITIES else value}
            if name == 'payload_mass':
                kind, data = 'payload', payload_of({**self._values, name: value}, simulation)
            try:
                apply_event(simulation, kind, data)
            except ChainError as error:
                if moving:
                    simulation.restore(before)
                return False, f'parameter {name!r}: {error}'
            changes.append((kind, data))
        self._values.update(values)
        if moving:
            self._meter.restart(simulation)
        if 'real_time_factor' in values:
            self._pacing.set_period(self._period(), simulation.tick, monotonic_ns())
        for kind, data in changes:
            if kind == 'payload':
                data['plan'] = simulation.plan   # of the chain with the payload
            self._publication.publish_event(kind, **data)
        return True, f'{", ".join(values)}: from tick {simulation.tick} on'

    @between_ticks(timeout=MEASURE_TIMEOUT, withdraw=True)
    def measure(self) -> tuple:
        """Return a Measurement."""
        return True, self._meter.measure(self._simulation.tick, self._intake, self._end, self._paused,
                                         self.hold_ups.total, self._waiting_for())

    def _waiting_for(self) -> tuple:
        """Return the names of the joints whose commands the next tick waits for, and since when, s."""
        return (), 0.0
