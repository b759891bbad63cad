"""Preparation of every test run, before any test module is imported."""
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
import os
from pathlib import Path
import signal
import socket
import sys
import tempfile

import pytest

ROOT = Path(__file__).resolve().parent.parent
HAS_ROS = find_spec('rclpy') is not None
collect_ignore = [] if HAS_ROS else ['ros']   # its modules import rclpy


def free_domain():
    """
    Return a ROS domain no other test run on this machine has, and the socket that keeps it ours until we exit.

    The port is the last one below the domain's own: DDS takes it for no participant of the domain before.
    """
    for domain in range(1, 101):
        keeper = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            keeper.bind(('127.0.0.1', 7400 + 250 * domain - 1))
            return domain, keeper
        except OSError:
            keeper.close()
    raise RuntimeError('no free ROS domain on this machine: 100 test runs at once')


# `colcon test` starts in the source tree to test what is installed; a source package without a kernel only hides that.
if not any((ROOT / 'planar_chain_sim' / f'_kernel{suffix}').exists() for suffix in EXTENSION_SUFFIXES):
    sys.path[:] = [entry for entry in sys.path if Path(entry).resolve() != ROOT]
    os.chdir(ROOT / 'test')  # the interpreters that tests start look in their working directory first

# Under nohup, or in the background of a shell, the processes that tests start would ignore these.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

domain, domain_keeper = free_domain()
log_folder = tempfile.TemporaryDirectory()
os.environ['ROS_DOMAIN_ID'] = str(domain)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_LOG_DIR'] = log_folder.name
os.environ.pop('ROS_LOCALHOST_ONLY', None)  # deprecated, but it would win


@pytest.fixture(autouse=True)
def stop_signals():
    """Put back what a test did to stop signals: an executable that it ran in this process catches or ignores them."""
    before = [(number, signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    yield
    for number, handler in before:
        if signal.getsignal(number) is not handler:
            signal.signal(number, handler)


def pytest_report_header():
    """Return a line that says what is left out."""
    return None if HAS_ROS else 'no rclpy: test/ros is left out, and tests marked ros are skipped'


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark all of test/ros, before `-m` selects by marks."""
    for item in items:
        if ROOT / 'test' / 'ros' in item.path.parents:
            item.add_marker('ros')
        elif not HAS_ROS and item.get_closest_marker('ros'):
            item.add_marker(pytest.mark.skip(reason='needs rclpy'))
