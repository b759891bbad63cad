"""The examples with ROS beside a real node: mistakes are told by the example itself, Ctrl-C leaves nothing behind."""
import json
from pathlib import Path

from live import Peer, Process, run, simulator
import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / 'examples'


@pytest.mark.parametrize('example, arguments', [('push', ['forearm', 5, 0]), ('send_effort', [1])])
def test_an_example_says_that_it_waits_for_the_simulator(example, arguments):
    with Process(example, *arguments, cwd=EXAMPLES) as process:
        process.wait_for('waiting for the simulator')
        assert process.stop() == 0 and 'Traceback' not in process.output, process.output


@pytest.fixture(scope='module')
def node():
    with simulator() as process:
        yield process


@pytest.mark.parametrize('example, arguments, sentence', [
    ('push', ['foo', 1, 0], "error: the simulator refuses the push: its frame_id is 'foo', must be the name of a body"),
    ('push', ['forearm', 'nan', 0], 'error: the force must be finite'),
    ('push', ['forearm', 1, 0, '--seconds', -1], 'seconds too and not negative'),
    ('send_effort', [1, 2], 'error: 2 efforts were given, must be 5: one for each of column_slide, column_joint'),
    ('send_effort', ['inf', 0, 0, 0, 0], 'error: efforts must be finite'),
    ('send_effort', [1, 0, 0, 0, 0, '--seconds', 'nan'], 'seconds too and not negative')])
def test_a_mistake_is_told_by_the_example(node, example, arguments, sentence):
    code, output = run(example, *arguments, cwd=EXAMPLES)
    assert code == 2 and sentence in output and 'Traceback' not in output, output


def test_ctrl_c_ends_a_push(node):
    with Peer() as peer:
        peer.meet()   # an event that is sent before the two have met is never seen
        with Process('push', 'forearm', 5, 0, '--seconds', 1000, cwd=EXAMPLES) as push:
            push.wait_for('pushing')
            peer.until(lambda: any('"wrench"' in event.data for event in peer.events), 'a push')
            assert push.stop() == 0 and 'Traceback' not in push.output, push.output
        peer.until(lambda: [json.loads(event.data)['data']['force'] for event in peer.events
                            if '"wrench"' in event.data][-1] == [0.0, 0.0], 'its end')
