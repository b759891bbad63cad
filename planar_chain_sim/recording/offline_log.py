"""OfflineLog: writes a run without ROS as a log, which `resimulate`, load_log and rosbag2 read like the node's."""
from __future__ import annotations

import json
from time import perf_counter
from typing import Any, Callable, Optional, TYPE_CHECKING

import numpy as np

from .cdr import JointStateLayout
from .events import apply_event, encode_command, encode_event, encode_joint_event, end_event, EVENTS
from .log_writer import LogWriter
from .recorded_frames import RecordedFrames
from .rosbag2_profile import Channel
from .run_settings import settings_of
from ..chain.joint_arrays import joint_array
from ..chain.quantities import QUANTITIES, to_json
from ..errors import SimulationError
from ..motion.simulation import Interrupted, Simulation

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

STATE_TOPIC, EVENTS_TOPIC = '/joint_states', '/simulator/events'   # what the node would publish them on
CHUNK = 1000   # ticks between two calls of `progress`, at most
LONG = 0.1     # s of wall time, beyond which fewer ticks are made between two calls


class OfflineLog:
    """
    Logs `simulation` into the new MCAP file `path`: move it with advance() and change it with change(), both logged.

    The log begins at the simulation's present tick and state, with its wrenches and payloads. Its state is set anew
    there, so that the run can be computed again from the log alone: hidden round-off terms are cleared. Log time is
    simulated time. `compression`: 'none', 'lz4' or 'zstd'. `record_tf`: log the chain's URDF and the frames of its
    links too, from which Foxglove draws the arm. LogError: the file exists or cannot be written, also later.
    ValueError: a simulation that is between two ticks.
    While the log is open, what changes the simulation in another way is refused by the next call of the log.

    A context manager; close() finishes the file. Example:

        with pcs.OfflineLog('swing.mcap', simulation) as log:
            log.advance(1000, effort=[1.0, 0.0])
            log.change('wrench', body='forearm', force=[5.0, 0.0])
            log.advance(1000)
    """

    def __init__(self, path: Any, simulation: Simulation, compression: str = 'none', record_tf: bool = False) -> None:
        if not isinstance(simulation, Simulation):
            raise TypeError(f'simulation is {simulation!r:.80}, must be a Simulation: Simulation(chain) makes one')
        self._simulation, joints = simulation, simulation.chain.joint_count
        if simulation.time != simulation.tick * simulation.step:
            raise ValueError(f'the simulation is at t = {simulation.time:.12g} s, between two ticks, must be at one')
        self._step, self._held = simulation.step, np.zeros(joints)
        self._layout = JointStateLayout(simulation.chain.joint_names)
        channels = [Channel(STATE_TOPIC, 'sensor_msgs/msg/JointState'), Channel(EVENTS_TOPIC, 'std_msgs/msg/String')]
        self._frames = _frames_of(simulation) if record_tf else None
        channels += self._frames.channels if self._frames else ()
        self._writer = LogWriter(path, channels, {'chain.yaml': simulation.own_chain.source.encode()},
                                 {'planar_chain_sim': settings_of(simulation, STATE_TOPIC, EVENTS_TOPIC)},
                                 compression=compression)
        simulation.set_state(simulation.position, simulation.velocity)
        if self._frames:
            self._frames.write_start(self._writer.write, self._nanoseconds(simulation.tick))
        self._write_state(simulation.tick, simulation.position, simulation.velocity, np.zeros(joints))
        self._write_loads()
        self._logged = self._scene()

    def __enter__(self) -> 'OfflineLog':
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    def close(self) -> None:
        """Finish the file; LogError where that fails."""
        self._writer.close()

    def advance(self, ticks: int, effort: Optional[ArrayLike] = None,
                progress: Callable[[int], object] = lambda ticks: None) -> None:
        """
        Advance `ticks` ticks under `effort`, N m or N: (joints,) is held, (ticks, joints) a row per tick, None zero.

        Each state is logged, each change of effort, and what happens at joints. `progress(n)` is called after n more
        ticks. ValueError, SimulationError and Interrupted as Simulation.advance; the ticks before are in the log.
        """
        simulation, joints = self._simulation, self._held.size
        efforts = self._checked_effort(ticks, effort)
        self._check_logged()
        position, velocity, acted = (np.empty((CHUNK, joints)) for _ in range(3))
        start, chunk = 0, 1
        while start < ticks:
            began, failure, first = perf_counter(), None, simulation.tick
            count = min(chunk, ticks - start)
            rows = efforts[start:start + count] if efforts.ndim == 2 else np.broadcast_to(efforts, (count, joints))
            try:
                simulation.advance(count, rows, record=(position[:count], velocity[:count], acted[:count]))
            except (SimulationError, Interrupted) as error:
                failure = error
            events = simulation.take_events()
            for k in range(simulation.tick - first):
                self._write_command(first + k, rows[k])
                while events and events[0].tick <= first + k:
                    event = events.pop(0)   # at its time between two ticks
                    self._write_message(encode_joint_event(event), round(event.time * 1e9))
                self._write_state(first + k + 1, position[k], velocity[k], acted[k])
            self._logged = self._scene()
            progress(simulation.tick - first)
            if isinstance(failure, SimulationError):
                self._write_event(failure.tick, *end_event(failure))
            if failure:
                raise failure
            start, quick = start + count, perf_counter() - began < LONG
            chunk = min(CHUNK, 2 * chunk) if quick else max(1, chunk // 2)

    def change(self, kind: str, **data: Any) -> None:
        """
        Change the simulation at its present tick and log that.

        Kinds and their data: 'reset'; 'state' (position, velocity); 'parameter' (name: gravity, damping or
        effort_limit; value, a list); 'wrench' (body, force, moment, axes); 'payload' (name, body, mass, position,
        inertia_com; a mass of 0 removes it). Defaults are those of Simulation.set_wrench and Simulation.attach.
        ValueError, and nothing is changed: another kind, bad data.
        """
        kinds = [name for name, row in EVENTS.items() if row.apply]
        if kind not in kinds:
            raise ValueError(f'the change is {kind!r}, must be one of {", ".join(map(repr, kinds))}')
        row, simulation = EVENTS[kind], self._simulation
        strange = [key for key in data if key not in row.keys]
        if strange:
            raise ValueError(f'the change {kind!r} has {strange[0]!r}, must have {", ".join(row.keys) or "no data"}')
        self._check_logged()
        data = {**row.defaults, **json.loads(json.dumps(data, default=_plain))}   # as the reader of the log gets it
        if kind == 'parameter' and data.get('name') not in (*QUANTITIES, None):   # the node has more, of its own
            raise ValueError(f'the parameter is {data["name"]!r}, must be one of {", ".join(map(repr, QUANTITIES))}')
        before = simulation.position.tobytes(), simulation.velocity.tobytes()
        apply_event(simulation, kind, data)
        if 'plan' in row.keys:
            data['plan'] = simulation.plan
        if kind == 'parameter':
            data['value'] = to_json(data['value'])
        self._write_event(simulation.tick, kind, data)
        if kind == 'reset':
            self._held = np.zeros_like(self._held)
        if before != (simulation.position.tobytes(), simulation.velocity.tobytes()):
            self._write_state(simulation.tick, simulation.position, simulation.velocity, simulation.effort)
        self._logged = self._scene()

    def _checked_effort(self, ticks: int, effort: Any) -> np.ndarray:
        """Return efforts as float64, (joints,) or (ticks, joints); ValueError."""
        if not isinstance(ticks, (int, np.integer)) or isinstance(ticks, bool) or ticks < 0:
            raise ValueError(f'ticks is {ticks!r}, must be a whole number >= 0')
        joints = self._held.size
        if effort is None:
            return np.zeros(joints)
        return joint_array('effort', effort, (ticks, joints) if np.ndim(effort) == 2 else (joints,))

    def _scene(self) -> tuple:
        """Return what the log has to know of the simulation, but for its time."""
        simulation = self._simulation
        return (simulation.position.tobytes() + simulation.velocity.tobytes(), simulation.wrenches, simulation.chain)

    def _check_logged(self) -> None:
        """Raise ValueError where the simulation was moved or changed, but not in the log."""
        simulation, scene = self._simulation, self._scene()
        if simulation.time != self._tick * self._step:
            raise ValueError(f'the simulation is at t = {simulation.time:.12g} s, its log at tick {self._tick}: '
                             'it must be moved by advance() of the log')
        if scene != self._logged:
            parts = zip(('state', 'wrenches', 'chain or payloads'), scene, self._logged)
            changed = ' and '.join(what for what, now, before in parts if now != before)
            raise ValueError(f"the simulation's {changed} changed at tick {self._tick}, but not in its log: "
                             'they must be changed by change() of the log')

    def _write_loads(self) -> None:
        """Log the payloads and wrenches that act already."""
        simulation = self._simulation
        bodies = simulation.chain.bodies
        for body in bodies[len(bodies) - len(simulation.payloads):]:
            self._write_event(simulation.tick, 'payload', {
                'name': body.name, 'body': bodies[body.carrier].name, 'mass': body.mass,
                'position': [body.origin.real, body.origin.imag], 'inertia_com': body.inertia, 'plan': simulation.plan})
        for body, (force, moment, axes) in simulation.wrenches.items():
            self._write_event(simulation.tick, 'wrench', {
                'body': body, 'force': [force.real, force.imag], 'moment': moment, 'axes': axes})

    def _write_state(self, tick: int, position: Any, velocity: Any, effort: Any) -> None:
        """Append the state (joints,) of a tick with the effort that acted over the tick before it."""
        layout, self._tick = self._layout, tick
        layout.position[:], layout.velocity[:], layout.effort[:] = position, velocity, effort
        time = self._nanoseconds(tick)
        self._writer.write(STATE_TOPIC, layout.stamped(time), time, time, tick)
        if self._frames and not tick % self._frames.ticks:
            self._frames.write_state(self._writer.write, layout.position, time, time)

    def _write_command(self, tick: int, effort: Any) -> None:
        """Append the event of a commanded effort (joints,) that acts from this tick on, if it differs from the last."""
        if effort.tobytes() != self._held.tobytes():
            self._held = effort.copy()
            self._write_message(encode_command(tick, '', self._held), self._nanoseconds(tick))

    def _write_event(self, tick: int, kind: str, data: dict) -> None:
        self._write_message(encode_event(tick, kind, data), self._nanoseconds(tick))

    def _write_message(self, event: bytes, time: int) -> None:
        self._writer.write(EVENTS_TOPIC, event, time, time)

    def _nanoseconds(self, tick: int) -> int:
        return round(tick * self._step * 1e9)


def _frames_of(simulation: Simulation) -> RecordedFrames:
    """Return the frames of the simulation's chain, by the URDF that this package writes."""
    from ..robot_files.link_frames import LinkFrames  # which other logs do not need
    from ..robot_files.urdf_writer import PLANE, urdf_of
    chain = simulation.own_chain
    urdf = urdf_of(chain)
    return RecordedFrames(urdf, LinkFrames(urdf, plane=PLANE), chain.joint_names, simulation.step)


def _plain(value: Any) -> Any:
    """Return what json.dumps cannot write, a NumPy array or number, as plain data."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise ValueError(f'{value!r:.80} cannot be written as JSON')
