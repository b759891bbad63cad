"""Processes and peers for the tests over real DDS: start an executable, talk to it from here, end it."""
import os
from pathlib import Path
import signal
import subprocess
import sys
from threading import Thread
import time

from rcl_interfaces.srv import GetParameters
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

from planar_chain_sim.ros.messages import PolledGroup

PATIENCE = 300.0  # s; a loaded machine may be slow, only a broken one is this slow
AGAIN = 0.2        # s after which what had no effect is done once more


class Process:
    """An executable of the package, as a user starts it, with its output read line by line."""

    def __init__(self, module, *arguments, **options):
        self.lines = []
        environment = dict(options.pop('env', os.environ), PYTHONPATH=os.pathsep.join(sys.path), PYTHONUNBUFFERED='1')
        command = [*options.pop('runner', ()), sys.executable, '-m', module, *map(str, arguments)]
        options = {'stdin': subprocess.DEVNULL, **options}   # the terminal of a test run is not theirs
        self.popen = subprocess.Popen(command, text=True, env=environment, stdout=subprocess.PIPE,
                                      stderr=subprocess.STDOUT, errors='replace', **options)
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        if self.popen.poll() is None:
            self.popen.kill()
        self.finish()

    def _read(self):
        with self.popen.stdout as stream:
            for line in stream:
                self.lines.append(line.rstrip('\n'))

    @property
    def output(self):
        return '\n'.join(self.lines)

    def wait_for(self, text):
        """Wait for a line that holds `text` and return it."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            found = next((line for line in self.lines if text in line), None)
            if found is not None:
                return found
            if self.popen.poll() is not None and not self._reader.is_alive():
                break
            time.sleep(0.005)
        raise AssertionError(f'no line with {text!r} from {self.popen.args}, but:\n{self.output}')

    def send(self, number):
        self.popen.send_signal(number)

    def finish(self):
        """Wait for the end and return the exit code, negative for the signal that killed it."""
        code = self.popen.wait(PATIENCE)
        self._reader.join(PATIENCE)
        return code

    def end_within(self, seconds):
        """Wait for the end; kill what has not ended by then."""
        try:
            self.popen.wait(seconds)
        except subprocess.TimeoutExpired:
            self.popen.kill()
        return self.finish()

    def stop(self, number=signal.SIGINT):
        """End it as a user does and return the exit code."""
        self.send(number)
        return self.finish()


def simulator(*remappings, ready=True, preexec_fn=None, **parameters):
    """Start the node with these parameters; with `ready`, wait until it runs."""
    parts = ['--ros-args']
    for name, value in parameters.items():
        parts += ['-p', f'{name}:={str(value).lower() if isinstance(value, bool) else value}']
    for remapping in remappings:
        parts += ['-r', remapping]
    process = Process('planar_chain_sim.ros.node', *parts, preexec_fn=preexec_fn)
    if ready:
        process.wait_for('running')
    return process


def _never_called(message):
    """Do nothing: rclpy requires a callback with a signature, which `print` lacks in Python 3.10."""


class Peer:
    """Another participant of the ROS graph, in this process: sees states and events, commands, calls services."""

    def __init__(self, name='simulator', namespace=''):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        # Without /rosout: of two nodes of one name in a process, the one that goes first takes the other's publisher.
        self.node = Node('peer', context=self.context, enable_rosout=False)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.states, self.events, self.listening = [], [], []
        self.full_name = full_name = f'{namespace}/{name}'
        # Polled, not spun: an executor takes longer over a message than a 1 kHz node takes to send the next.
        self.states_in = self.node.create_subscription(JointState, f'{namespace}/joint_states', _never_called, 1000,
                                                       callback_group=PolledGroup())
        self.events_in = self.node.create_subscription(String, f'{full_name}/events', _never_called, 1000,
                                                       callback_group=PolledGroup())
        self.commands = self.node.create_publisher(Float64MultiArray, f'{full_name}/commands', 64)
        self.joint_commands = self.node.create_publisher(JointState, f'{full_name}/joint_commands', 64)
        self.parameters = AsyncParameterClient(self.node, full_name)
        self.services = {'reset': self.node.create_client(Trigger, f'{full_name}/reset'),
                         'step': self.node.create_client(Trigger, f'{full_name}/step'),
                         'pause': self.node.create_client(SetBool, f'{full_name}/pause')}

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        # Fast DDS 2.14 can hang in a participant that ends just when it hears that another one has gone.
        seen, calm = None, 0
        while calm < 5:
            known = sorted(self.node.get_node_names()), self.states_in.get_publisher_count()
            calm, seen = (calm + 1 if known == seen else 0), known
            time.sleep(0.01)
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def poll(self):
        """Take all messages that have come."""
        for subscription, taken in ((self.states_in, self.states), (self.events_in, self.events), *self.listening):
            with subscription.handle:
                while (message := subscription.handle.take_message(subscription.msg_type, False)) is not None:
                    taken.append(message[0])

    def until(self, condition, what='the condition', again=None):
        """
        Take messages and answers until `condition()` is true and return what it returns.

        `again()` is called if it is not, and once more after each AGAIN s in vain.
        """
        begun, pause, due = time.monotonic(), 0.001, 0.0
        self.poll()
        while not (result := condition()):
            assert (now := time.monotonic()) < begun + PATIENCE, f'{what} has not come in {PATIENCE} s'
            if again and now >= due:
                again()
                due = time.monotonic() + AGAIN
            self.executor.spin_once(timeout_sec=pause)
            self.poll()
            pause = min(1.2 * pause, 0.02)   # an answer that is soon there is seen at once, a long wait costs little
        return result

    def meet(self):
        """Wait until either side receives whatever the other sends from now on."""
        self.until(lambda: self.commands.get_subscription_count() and self.joint_commands.get_subscription_count()
                   and self.states_in.get_publisher_count() and self.events_in.get_publisher_count(), 'a match')
        for client in self.services.values():
            self.until(client.service_is_ready, 'a service')
        # Our side knows the node's writers; does the node know our readers? It hears of them in the order in which they
        # were made. So it knows them all when its answer reaches the newest, that of a client made now.
        newest, asked = self.node.create_client(GetParameters, f'{self.full_name}/get_parameters'), []
        self.until(newest.service_is_ready, 'a service')
        self.until(lambda: any(future.done() for future in asked), 'an answer',   # one that comes too soon is lost
                   lambda: asked.append(newest.call_async(GetParameters.Request(names=['rate']))))
        self.node.destroy_client(newest)
        return self

    def listen(self, message, topic, latched=False):
        """Return a list that poll() fills with the messages of a topic."""
        taken = []
        qos = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else
                         DurabilityPolicy.VOLATILE)
        self.listening.append((self.node.create_subscription(message, topic, _never_called, qos,
                                                             callback_group=PolledGroup()), taken))
        return taken

    def ask(self, future, what='an answer'):
        """Return what a service answers."""
        self.until(future.done, what)
        return future.result()

    def set(self, **values):
        """Set parameters, each on its own, and return (success, reason) of each."""
        self.until(self.parameters.services_are_ready, 'the parameter services')
        response = self.ask(self.parameters.set_parameters([Parameter(k, value=v) for k, v in values.items()]))
        return [(result.successful, result.reason) for result in response.results]

    def call(self, service, *data):
        """Call a service and return (success, message)."""
        client = self.services[service]
        future = client.call_async(client.srv_type.Request(**({'data': data[0]} if data else {})))
        self.until(future.done, f'the answer of {service}')
        return future.result().success, future.result().message

    def new_state(self, condition=lambda state: True):
        """Return the next state, not one that has come already, for which the condition holds."""
        self.poll()
        first = len(self.states)
        return self.until(lambda: next((state for state in self.states[first:] if condition(state)), None), 'a state')

    def standing_state(self):
        """Return the state of a paused simulation: one that has come twice, so that none from before can follow."""
        self.poll()
        first = len(self.states)
        return self.until(lambda: next((new for old, new in zip(self.states[first:], self.states[first + 1:])
                                        if old.header.stamp == new.header.stamp), None), 'a standing state')


def stamp_ns(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def run(module, *arguments, **options):
    """Run an executable to its end; return exit code and output."""
    with Process(module, *arguments, **options) as process:
        code = process.finish()
    return code, process.output


CONFIG = Path(__file__).resolve().parents[2] / 'config'
