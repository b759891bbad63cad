"""A system clock that is wrong or jumps, and use_sim_time: one sentence or no difference, never a traceback."""
import os
from pathlib import Path
import shutil
import struct
import subprocess
import time

from live import Peer, Process, run, simulator, stamp_ns
import pytest
from std_msgs.msg import Float64MultiArray

YEAR = round(365.2425 * 86400e9)  # ns
ROOT = Path(__file__).resolve().parent


@pytest.fixture(scope='module')
def preload(tmp_path_factory):
    """Return the library that shifts the system clock of a process that preloads it."""
    compiler = os.environ.get('CXX') or shutil.which('c++') or shutil.which('g++')
    library = tmp_path_factory.mktemp('clock') / 'shifted_clock.so'
    subprocess.run([compiler, '-shared', '-fPIC', '-o', library, ROOT / 'shifted_clock.cpp', '-ldl'], check=True)
    return library


class Clock:
    """The system clock of the processes that are started meanwhile."""

    def __init__(self, path, monkeypatch, library):
        self._path, self._monkeypatch = path, monkeypatch
        self.shift(0)
        monkeypatch.setenv('CLOCK_SHIFT', str(path))
        monkeypatch.setenv('LD_PRELOAD', str(library))

    def shift(self, years):
        """Set it so many years off, in all that run too."""
        with open(self._path, 'r+b' if self._path.exists() else 'wb') as file:
            file.write(struct.pack('<q', round(years * YEAR)))

    def release(self):
        """Let those that are started from now on have the true one."""
        self._monkeypatch.delenv('LD_PRELOAD')


@pytest.fixture
def clock(tmp_path, monkeypatch, preload):
    return Clock(tmp_path / 'shift', monkeypatch, preload)


@pytest.mark.parametrize('module', ['node', 'replay', 'example_controller'])
@pytest.mark.parametrize('years', [14, 30, 200, -60, -100])
def test_a_year_that_ros_cannot_carry_is_told_in_one_sentence(clock, module, years, tmp_path):
    log = tmp_path / 'run.mcap'
    arguments = []
    if module == 'replay':
        assert run('planar_chain_sim.recording.rollout', 'double_pendulum.yaml', '--duration', 0.1, '--output', log,
                   '--effort', '1,2')[0] == 0
        arguments = [log, '--what', 'states']
    clock.shift(years)
    with Process(f'planar_chain_sim.ros.{module}', *arguments) as process:
        assert process.finish() == 2
    sentence, = process.lines
    assert 'the system clock is in the year' in sentence and sentence.endswith('to January 2038 only: set the clock')


def test_at_time_zero_all_is_as_ever(clock, tmp_path):
    log = tmp_path / 'run.mcap'
    clock.shift(-time.time() / 86400 / 365.2425 + 1e-5)   # five minutes after the epoch
    with simulator('__ns:=/zero', record=log) as process:
        clock.release()
        with Peer(namespace='/zero') as peer:
            peer.meet()
            peer.commands.publish(Float64MultiArray(data=[1.0] * 5))
            state = peer.new_state(lambda state: state.effort[0] == 1.0)
            assert 0 < stamp_ns(state) < 4000e9
            assert process.stop() == 0, process.output
    assert 'Traceback' not in process.output
    assert run('planar_chain_sim.resimulation.command_line', log)[0] == 0


def test_a_clock_that_is_set_back_changes_nothing(clock, tmp_path):
    log = tmp_path / 'run.mcap'
    with simulator('__ns:=/back', record=log, lockstep=True) as process:
        clock.release()
        with Peer(namespace='/back') as peer:
            peer.meet()
            for k, years in enumerate([0, 0, -0.5, -20, -20, -1, 0]):
                state = peer.new_state()
                clock.shift(years)
                peer.commands.publish(Float64MultiArray(data=[float(k)] * 5))
                # Where the clock was set back the answer looks too old, until the state is shown again.
                peer.until(lambda: stamp_ns(peer.states[-1]) > stamp_ns(state) or len(peer.states) > 10**6
                           or peer.new_state() is None or peer.commands.publish(Float64MultiArray(data=[float(k)] * 5)))
            assert process.stop() == 0, process.output
    assert 'Traceback' not in process.output
    assert run('planar_chain_sim.resimulation.command_line', log)[0] == 0


def test_a_clock_that_is_set_past_2038_ends_the_node_with_a_sentence_and_a_whole_log(clock, tmp_path):
    log = tmp_path / 'run.mcap'
    with simulator('__ns:=/past', record=log, lockstep=True) as process:
        clock.release()
        with Peer(namespace='/past') as peer:
            peer.meet()
            state = peer.new_state()
            peer.commands.publish(Float64MultiArray(data=[1.0] * 5))
            peer.new_state(lambda new: stamp_ns(new) > stamp_ns(state))
            clock.shift(14)
            peer.commands.publish(Float64MultiArray(data=[2.0] * 5))
            assert process.finish() == 2
    assert 'simulator: the system clock is in the year' in process.output   # ROS itself may complain at its end
    assert 'Traceback' not in process.output
    assert run('planar_chain_sim.resimulation.command_line', log)[0] == 0


@pytest.mark.parametrize('clock_is_ours, words', [
    (True, 'use_sim_time is set and this node is the clock'),
    (False, 'use_sim_time is set, but this node keeps wall time and stamps with it')])
def test_use_sim_time_says_what_it_does_when_it_is_set(clock_is_ours, words):
    with simulator('__ns:=/sim', publish_clock=clock_is_ours) as process, Peer(namespace='/sim') as peer:
        peer.meet()
        assert peer.set(use_sim_time=True) == [(True, '')]
        process.wait_for(words)
        listeners = peer.node.count_subscribers('/clock')
        peer.until(lambda: not peer.node.count_subscribers('/clock'), f'the end of {listeners} subscriptions')
        for _ in range(10):   # a subscription that came and went with it has ended the node now and then
            assert peer.set(use_sim_time=False) == peer.set(use_sim_time=True) == [(True, '')]
        assert peer.set(use_sim_time=False) == [(True, '')]
        process.wait_for('use_sim_time is off, which changes nothing')
        peer.new_state()
        assert process.stop() == 0, process.output
