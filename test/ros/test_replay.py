"""replay over real DDS: the recorded bytes, on the recorded topics, at the recorded pace."""
import os
from pathlib import Path
import signal
import subprocess
import sys
import termios
import time

from live import CONFIG, PATIENCE, Peer, Process, run, simulator, stamp_ns
import pytest
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from planar_chain_sim.recording.cdr import (
    decode_clock,
    decode_float64_multi_array,
    decode_joint_state,
    encode_float64_multi_array,
    encode_string,
    JointStateLayout,
)
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.log_writer import LogWriter
from planar_chain_sim.recording.rollout import main as rollout
from planar_chain_sim.recording.rosbag2_profile import Channel
from planar_chain_sim.ros.messages import PolledGroup

REPLAY = 'planar_chain_sim.ros.replay'
STATES, COMMANDS, BY_NAME = '/joint_states', '/simulator/commands', '/simulator/joint_commands'
START = 1_700_000_000_000_000_000
COUNT, APART = 40, 20_000_000  # messages on each topic, ns


@pytest.fixture(scope='module')
def log(tmp_path_factory):
    """Return a log with COUNT states, and commands of both kinds right after each."""
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    layout = JointStateLayout(['a', 'b'])
    channels = [Channel(STATES, 'sensor_msgs/msg/JointState'), Channel('/simulator/events', 'std_msgs/msg/String'),
                Channel(COMMANDS, 'std_msgs/msg/Float64MultiArray'), Channel(BY_NAME, 'sensor_msgs/msg/JointState')]
    settings = {'state_topic': STATES, 'events_topic': '/simulator/events'}
    with LogWriter(path, channels, {'chain.yaml': b''}, {'planar_chain_sim': settings}) as writer:
        for k in range(COUNT):
            now = START + k * APART
            layout.position[:] = k, -k
            writer.write(STATES, layout.stamped(now), now, now, k)
            writer.write(COMMANDS, encode_float64_multi_array([k, 0.5]), now, now)
            layout.effort[:] = 3 * k, 0.1
            writer.write(BY_NAME, layout.stamped(now), now, now)
            writer.write('/simulator/events', encode_string('{}'), now, now)
    return path


def position_of(data):
    """Return the number of a state of the log."""
    return int(decode_joint_state(data).position[0])


class Listener:
    """Takes the bytes on some topics, with the time at which they were sent."""

    def __init__(self, **topics):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node('listener', context=self.context)
        self.heard = {topic: [] for topic in topics}
        self.subscriptions = {
            topic: self.node.create_subscription(message, f'/{topic.replace("__", "/")}', lambda _: None, 1000,
                                                 callback_group=PolledGroup(), raw=True)
            for topic, message in topics.items()}

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.node.destroy_node()
        self.context.try_shutdown()

    def listen_to(self, process):
        """Listen until the process ends and return its exit code."""
        self.listen_until(lambda: process.popen.poll() is not None)
        return process.finish()

    def listen_until(self, condition):
        """Listen until `condition()` is true, and once more."""
        end, done = time.monotonic() + PATIENCE, False
        while not done:
            assert time.monotonic() < end, f'it has not come in {PATIENCE} s'
            done = condition()
            self.listen()
            time.sleep(0.005)

    def listen(self):
        for topic, subscription in self.subscriptions.items():
            with subscription.handle:
                while (taken := subscription.handle.take_message(subscription.msg_type, True)) is not None:
                    self.heard[topic].append((taken[0], taken[1]['source_timestamp']))

    def check_pace(self, topic, apart):
        """Assert that messages were sent so far apart, ns: over some stretch, as a busy machine is late elsewhere."""
        sent = [sent for _, sent in self.heard[topic]]
        paces = [(sent[k] - sent[j]) / (k - j) for k in range(len(sent)) for j in range(k - 9)]
        assert min(paces) < 1.2 * apart and max(paces) > 0.8 * apart, (min(paces), max(paces))


def test_commands_are_replayed_as_recorded_and_at_the_recorded_pace(log):
    with Listener(simulator__commands=Float64MultiArray, simulator__joint_commands=JointState,
                  joint_states=JointState) as listener:
        with Process(REPLAY, log, '--wait', PATIENCE) as process:
            assert listener.listen_to(process) == 0, process.output
    commands = [data for data, _ in listener.heard['simulator__commands']]
    assert commands == [encode_float64_multi_array([k, 0.5]) for k in range(COUNT)]
    assert len(listener.heard['simulator__joint_commands']) == COUNT
    assert not listener.heard['joint_states']
    listener.check_pace('simulator__commands', APART)


def test_states_remapped_slower_and_from_later_on(log):
    with Listener(shown=JointState, simulator__commands=Float64MultiArray) as listener:
        with Process(REPLAY, log, '--what', 'states', '--speed', 0.5, '--start', 0.4, '--wait', PATIENCE,
                     '--ros-args', '-r', 'joint_states:=shown') as process:
            assert listener.listen_to(process) == 0, process.output
    layout = JointStateLayout(['a', 'b'])
    for k, (data, _) in enumerate(listener.heard['shown'], start=20):
        layout.position[:] = k, -k
        layout.effort[:] = (3 * (k - 1), 0.1)
        assert data == layout.stamped(START + k * APART)
    assert len(listener.heard['shown']) == COUNT - 20 and not listener.heard['simulator__commands']
    listener.check_pace('shown', APART / 0.5)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_loop_goes_on_until_a_signal(log, number):
    with Listener(joint_states=JointState) as listener:
        with Process(REPLAY, log, '--what', 'states', '--speed', 20, '--loop', '--wait', PATIENCE) as process:
            listener.listen_until(lambda: len(listener.heard['joint_states']) >= 3 * COUNT)
            assert process.stop(number) == 0
    assert 'Traceback' not in process.output


def test_recorded_commands_drive_a_simulator(tmp_path):
    recorded = tmp_path / 'recorded.mcap'
    sent = [[float(k), 0.0, 0.1, 0.2, 0.3] for k in range(1, 11)]
    with simulator(record=recorded) as process, Peer() as peer:
        peer.meet()
        for effort in sent:
            peer.commands.publish(Float64MultiArray(data=effort))
            begun = stamp_ns(peer.new_state(lambda state: list(state.effort) == effort))
            peer.new_state(lambda state: stamp_ns(state) > begun + 100_000_000)  # apart on a busy machine, too
        assert process.stop() == 0
    again = tmp_path / 'again.mcap'
    with simulator(record=again) as process, Peer() as peer:
        peer.meet()
        with Process(REPLAY, recorded, '--wait', PATIENCE) as player:
            peer.new_state(lambda state: list(state.effort) == sent[-1])
            assert player.finish() == 0, player.output
        assert process.stop() == 0
    # As received: on a busy machine two may fall into one tick, and then only the newer acts.
    heard = [list(decode_float64_multi_array(message.data)) for message in read_log(again).messages
             if message.topic == '/simulator/commands']
    assert heard == sent


def test_a_part_of_the_log_with_its_clock(log):
    with Listener(joint_states=JointState, clock=Clock) as listener:
        with Process(REPLAY, log, '--what', 'states', '--start', 0.2, '--duration', 0.3, '--clock',
                     '--wait', 60) as process:
            assert listener.listen_to(process) == 0, process.output
    assert [position_of(data) for data, _ in listener.heard['joint_states']] == list(range(10, 26))
    times = [decode_clock(data) for data, _ in listener.heard['clock']]
    assert times == sorted(times) and len(set(times)) > 3   # with a depth of 1 some may be lost, but not the last
    assert START + 10 * APART <= times[0] and times[-1] == START + 25 * APART


class Job(Process):
    """replay as a job of a terminal of its own; `terminal` is the end at which the user sits."""

    def __init__(self, *arguments):
        self.terminal, theirs = os.openpty()
        self.plain = termios.tcgetattr(self.terminal)
        runner = [sys.executable, str(Path(__file__).with_name('terminal_job.py')), os.ttyname(theirs)]
        super().__init__(REPLAY, *arguments, runner=runner, stdin=subprocess.PIPE, start_new_session=True)
        os.close(theirs)

    def __exit__(self, *exception):
        if not any(line.startswith('ended ') for line in self.lines):
            os.kill(self.number, signal.SIGKILL)
        self.popen.stdin.close()   # at which the shell ends
        super().__exit__(*exception)
        os.close(self.terminal)

    @property
    def number(self):
        """The job's process id."""
        return int(self.wait_for('job ').split()[1])

    def tell(self, word):
        self.popen.stdin.write(f'{word}\n')
        self.popen.stdin.flush()

    def press(self, keys, answer):
        """Press keys and return the seconds of the log that a new line with this answer names."""
        before = sum(answer in line for line in self.lines)
        os.write(self.terminal, keys)
        end = time.monotonic() + PATIENCE
        while len(found := [line for line in self.lines if answer in line]) == before:
            assert time.monotonic() < end, self.output
            time.sleep(0.005)
        return float(found[-1].partition(answer)[2].split()[0])

    def wait_for_keys(self):
        """Wait until keys come unseen and one by one."""
        end = time.monotonic() + PATIENCE
        while termios.tcgetattr(self.terminal)[3] & (termios.ICANON | termios.ECHO):
            assert time.monotonic() < end, self.output
            time.sleep(0.005)


def test_keys_pause_step_and_go_on(log):
    with Listener(joint_states=JointState) as listener, Job(log, '--what', 'states', '--loop', '--wait', 60) as job:
        job.tell('fg')
        heard = listener.heard['joint_states']
        listener.listen_until(lambda: heard)
        job.wait_for_keys()
        paused = job.press(b' ', 'paused at ')
        time.sleep(0.3)
        stepped = [job.press(key, 'stepped to ') for key in (b's', b'\x1b[C', b'\x1bOC', b's')]
        first = round(stepped[0] / 0.02) % COUNT
        assert stepped == pytest.approx([(first + k) % COUNT * 0.02 for k in range(4)], abs=1e-9)
        assert -1e-6 < stepped[0] - paused < 0.02 + 1e-6 or first == 0    # no time has gone by
        listener.listen_until(lambda: position_of(heard[-1][0]) == (first + 3) % COUNT)
        assert job.press(b' ', 'goes on from ') == stepped[-1]
        listener.listen_until(lambda: len(heard) > 3 * COUNT)
        assert [position_of(data) for data, _ in heard] == [k % COUNT for k in range(len(heard))]
        os.write(job.terminal, b'\x03')
        job.tell('watch')
        job.wait_for('ended 0')
        assert termios.tcgetattr(job.terminal) == job.plain


def test_the_terminal_is_put_back_and_a_background_job_goes_on(log):
    with Listener(joint_states=JointState) as listener, Job(log, '--what', 'states', '--loop', '--wait', 60) as job:
        heard = listener.heard['joint_states']
        listener.listen_until(lambda: len(heard) > 5)             # in the background it does not wait for the terminal
        assert termios.tcgetattr(job.terminal) == job.plain
        job.tell('fg')
        job.wait_for_keys()
        os.write(job.terminal, b'\x1a')
        job.tell('watch')
        job.wait_for('stopped')
        assert termios.tcgetattr(job.terminal) == job.plain
        job.tell('bg')
        before = len(heard)
        listener.listen_until(lambda: len(heard) > before + 5)
        assert termios.tcgetattr(job.terminal) == job.plain
        job.tell('fg')
        job.wait_for_keys()
        os.kill(job.number, signal.SIGTERM)
        job.tell('watch')
        job.wait_for('ended 0')
        assert termios.tcgetattr(job.terminal) == job.plain and 'Traceback' not in job.output


def test_nobody_listens(log):
    code, output = run(REPLAY, log, '--wait', 0, '--speed', 20)
    assert code == 0
    assert 'nobody listens on /simulator/commands, /simulator/joint_commands' in output


@pytest.mark.parametrize('arguments, sentence', [
    (['--speed', '0'], '--speed is 0.0, must be a finite number > 0'),
    (['--speed', 'nan'], '--speed is nan, must be a finite number > 0'),
    (['--start', '-1'], '--start is -1.0, must be a finite number of seconds >= 0'),
    (['--what', 'all'], "argument --what: invalid choice: 'all'"),
    (['--start', '0.9'], 'it holds no commands after 0.9 s'),
    (['--start', '1e300'], 'it holds no commands after 1e+300 s'),
    (['--speed', '1e-300'], '--speed is 1e-300, at which the log would take 0.78 s / 1e-300, must be one at which'),
    (['--start', '0.5', '--duration', '0'], '--duration is 0.0, must be a finite number of seconds > 0'),
    (['--duration', 'inf'], '--duration is inf, must be a finite number of seconds > 0'),
    (['--start', '0.9', '--duration', '1'], 'it holds no commands after 0.9 s within 1 s'),
    (['--speed', '-1e300'], '--speed is -1e+300, must be a finite number > 0'),
    (['--wait', '-1e-3'], '--wait is -0.001, must be a finite number of seconds >= 0')])
def test_a_bad_option_is_one_sentence(log, arguments, sentence):
    code, output = run(REPLAY, log, *arguments)
    assert code == 2 and output.count('\n') == 0
    assert output.startswith('replay: ') and sentence in output


def test_names_that_are_not_ascii(log, tmp_path):
    """A file whose name is no UTF-8 at all is replayed; a topic of the log that ROS refuses is one sentence."""
    odd = tmp_path / 'l\udcffuf \u00e4.mcap'
    odd.write_bytes(log.read_bytes())
    code, output = run(REPLAY, odd, '--wait', 0, '--speed', 1e300)
    assert code == 0 and '\u00e4.mcap' in output
    code, output = run(REPLAY, tmp_path / 'g\udcff.mcap')
    assert code == 2 and output.count('\n') == 0 and 'No such file' in output
    path = tmp_path / 'topic.mcap'
    with LogWriter(path, [Channel('/gr\u00f6\u00dfe', 'std_msgs/msg/Float64MultiArray')], {'chain.yaml': b''},
                   {'planar_chain_sim': {'state_topic': STATES, 'events_topic': '/e'}}) as writer:
        writer.write('/gr\u00f6\u00dfe', encode_float64_multi_array([1.0]), START, START)
    code, output = run(REPLAY, path)
    assert code == 2 and output.count('\n') == 0 and "topic '/gr\u00f6\u00dfe' of the log: " in output, output


def test_a_bad_log_is_one_sentence(tmp_path):
    missing = tmp_path / 'no.mcap'
    code, output = run(REPLAY, missing)
    assert code == 2 and output == f"replay: log '{missing}': it cannot be read (No such file or directory)"
    rolled = tmp_path / 'rolled.mcap'
    assert rollout([str(CONFIG / 'four_link_robot.yaml'), '--duration', '0.1', '--output', str(rolled)]) == 0
    code, output = run(REPLAY, rolled)
    assert code == 2 and output == f"replay: log '{rolled}': it holds no commands"
