"""Publishes on /diagnostics once a second: timing, rejected commands, energy, and the log."""
from __future__ import annotations

from time import time_ns

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from .pacing import LAST_STAMP

PERIOD = 1.0  # s
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Diagnostics:
    """
    Publishes what the Simulator measures on `publisher`, at each report().

    `values`: the node's parameters. `log`: BackgroundLogWriter or None. `name`: the node's, with its namespace.
    `neighbours`: Neighbours.
    """

    def __init__(self, name: str, simulator, publisher, values, log, hardware: str, neighbours):
        self._name, self._simulator, self._publisher = name, simulator, publisher
        self._values, self._log, self._hardware = values, log, hardware
        self._neighbours = neighbours
        self._before = 0, 0.0, 0, 0  # missed ticks, dropped s, rejected and ignored commands by the last report

    def report(self) -> None:
        """Publish one message; if the tick thread does not answer, the message says so."""
        answered, measured = self._simulator.measure()
        if answered:
            statuses = [self._simulation(measured), self._commands(measured), self._log_state(), self._network()]
            self._before = (measured.missed, measured.dropped, sum(measured.rejected.values()),
                            sum(measured.ignored.values()))
        else:
            statuses = [self._status('simulation', ERROR, self._simulator.requests.tick_under_way or measured, {})]
        message = DiagnosticArray(status=statuses)
        message.header.stamp = Time(sec=(now := min(time_ns(), LAST_STAMP)) // 10**9, nanosec=now % 10**9)
        self._simulator.hold_ups.during(self._publisher.publish, message)

    def _status(self, part: str, level: bytes, sentence: str, values: dict) -> DiagnosticStatus:
        return DiagnosticStatus(name=f'{self._name}: {part}', level=level, message=sentence, hardware_id=self._hardware,
                                values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])

    def _simulation(self, measured) -> DiagnosticStatus:
        missed, dropped = measured.missed - self._before[0], measured.dropped - self._before[1]
        values = {
            'real_time_factor': f'{measured.real_time_factor:.4g}',
            'real_time_factor wanted': f'{self._values["real_time_factor"]:g}',
            'tick': measured.tick,
            'missed ticks': measured.missed,
            'dropped ticks': round(measured.dropped * self._values['rate'] * self._values['real_time_factor']),
            'dropped time, s': f'{measured.dropped:.6g}',
            'publishing held up, s': f'{measured.held_up:.6g}',
            'lateness mean, s': f'{measured.lateness[0]:.3g}',
            'lateness largest, s': f'{measured.lateness[1]:.3g}',
            'energy balance error, J': f'{measured.energy_error:.3g}',
            'energy balance error, relative': f'{measured.energy_error / measured.energy_size:.3g}',
        }
        if measured.end:
            error, what = measured.end, 'divergence' if measured.end.ran_away else 'stopped'
            values.update({f'{what} joint': error.joint, f'{what} body': error.body,
                           f'{what} time, s': repr(error.time),
                           'last good position': error.position.tolist(),
                           'last good velocity': error.velocity.tolist()})
            return self._status('simulation', ERROR, str(error), values)
        if dropped:
            return self._status('simulation', WARN, f'{dropped:.3f} s dropped, the machine cannot keep up', values)
        sentence = 'paused' if measured.paused else 'running'
        if self._values['lockstep'] and not measured.paused:
            joints, seconds = measured.waiting
            values['waiting for commands for'] = ', '.join(joints[:32])
            if seconds >= PERIOD:
                return self._status('simulation', WARN, f'waiting for a command for {", ".join(joints[:32])}, for '
                                    f'{seconds:.3g} s so far', values)
            sentence = 'in lockstep with its controllers'
        return self._status('simulation', OK, sentence + (f', {missed} ticks came late' if missed else ''), values)

    def _commands(self, measured) -> DiagnosticStatus:
        values, fresh = {}, {}
        for what, before in zip(('rejected', 'ignored'), self._before[2:]):
            counts = getattr(measured, what)
            values[what] = sum(counts.values())
            values.update({f'{what}, {reason}': number for reason, number in counts.items()})
            fresh[what] = values[what] - before
        values['superseded'] = measured.superseded
        told = [f'{count} {what}' for what, count in fresh.items() if count]
        return self._status('commands', WARN if told else OK, ', '.join(told) or 'none rejected', values)

    def _network(self) -> DiagnosticStatus:
        faults = self._neighbours.faults
        return self._status('network', WARN if faults else OK, faults[0] if faults else 'no faults',
                            {f'fault {place}': fault for place, fault in enumerate(faults, 1)})

    def _log_state(self) -> DiagnosticStatus:
        if not self._log:
            return self._status('log', OK, 'off', {})
        values = {'path': self._values['record'], 'waiting messages': self._log.backlog}
        trouble = self._log.trouble
        return self._status('log', ERROR if self._log.error else WARN if trouble else OK, trouble or 'writing', values)
