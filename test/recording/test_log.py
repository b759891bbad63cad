"""The log's writers and its reader: what is written is read back, and errors are reported at once."""
from errno import ENOSPC
import os
from pathlib import Path
from random import Random
from struct import unpack_from
from threading import Thread
import time

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader
import pytest
from recorded_run import CHAIN_TEXT, CHANNELS, EXTRAS, recorded, SETTINGS, START, write, write_log

from planar_chain_sim.recording import log_writer
from planar_chain_sim.recording.cdr import encode_string
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.log_writer import BackgroundLogWriter, Channel, LogError, LogWriter
from planar_chain_sim.recording.mcap_file import McapFile


@pytest.mark.parametrize('compression', log_writer.COMPRESSIONS)
def test_round_trip(tmp_path, compression):
    messages = recorded(1000)
    log = read_log(write_log(tmp_path / 'run.mcap', messages, compression=compression))
    assert list(log.messages) == messages
    assert list(log.messages) == messages   # a second pass
    assert (log.chain_text, log.settings, log.complete) == (CHAIN_TEXT, SETTINGS, True)


def test_background_round_trip(tmp_path):
    messages = recorded(1000)
    with BackgroundLogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS) as writer:
        write(writer, messages)
    writer.write('/joint_states', b'too late', START, START)
    assert (writer.error, writer.backlog) == (None, 0)
    log = read_log(tmp_path / 'run.mcap')
    assert (list(log.messages), log.complete) == (messages, True)


def test_background_writer_takes_all_threads(tmp_path):
    def produce(topic):
        for index in range(2000):
            writer.write(topic, encode_string(str(index)), START + index, START, index)

    topics = ['/a', '/b', '/c']
    with BackgroundLogWriter(tmp_path / 'run.mcap', [Channel(topic, 'std_msgs/msg/String') for topic in topics],
                             **EXTRAS) as writer:
        threads = [Thread(target=produce, args=(topic,)) for topic in topics]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert writer.error is None
    messages = list(read_log(tmp_path / 'run.mcap').messages)
    for topic in topics:
        assert [message.sequence for message in messages if message.topic == topic] == list(range(2000))
    log_times = [message.log_time for message in messages]
    assert log_times == sorted(log_times)


def test_log_time_never_goes_back(tmp_path):
    with LogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS) as writer:
        for log_time in (20, 10, 30, 29):
            writer.write('/joint_states', b'', log_time, log_time)
    messages = list(read_log(tmp_path / 'run.mcap').messages)
    assert [message.log_time for message in messages] == [20, 20, 30, 30]
    assert [message.publish_time for message in messages] == [20, 10, 30, 29]


@pytest.mark.parametrize('kind', [LogWriter, BackgroundLogWriter])
def test_sequence_is_taken_modulo_two_to_the_32(kind, tmp_path):
    with kind(tmp_path / 'run.mcap', CHANNELS, **EXTRAS) as writer:
        writer.write('/joint_states', b'', 1, 1, 2 ** 32 + 5)
    assert [message.sequence for message in read_log(tmp_path / 'run.mcap').messages] == [5]


def test_a_log_without_messages_is_whole(tmp_path):
    path = write_log(tmp_path / 'run.mcap', [])
    log = read_log(path)
    assert (list(log.messages), log.complete) == ([], True)
    with open(path, 'rb') as file:
        assert len(make_reader(file).get_summary().channels) == len(CHANNELS)


@pytest.mark.parametrize('change, reason', [
    ({'flush_period': 0.0}, 'flush_period'), ({'flush_period': float('nan')}, 'flush_period'),
    ({'compression': 'gzip'}, 'gzip'), ({'channels': [Channel('/a', 'std_msgs/msg/Bool')]}, 'std_msgs/msg/Bool'),
    ({'channels': [CHANNELS[0], CHANNELS[0]]}, 'same topic'),
    ({'path': 'missing/run.mcap'}, "'missing' does not exist"), ({'path': '.'}, 'directory'),
    ({'path': 'there.mcap'}, 'not overwritten'), ({'path': 'a\0b'}, 'null'), ({'path': 'x' * 300}, 'too long')])
@pytest.mark.parametrize('kind', [LogWriter, BackgroundLogWriter])
def test_refused_at_once(tmp_path, monkeypatch, kind, change, reason):
    monkeypatch.chdir(tmp_path)
    Path('there.mcap').write_text('precious')
    with pytest.raises(LogError, match=reason) as caught:
        kind(**{'path': 'run.mcap', 'channels': CHANNELS, **EXTRAS, **change})
    assert '\n' not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ['there.mcap']
    assert Path('there.mcap').read_text() == 'precious'


def test_a_topic_without_channel_harms_nothing(tmp_path):
    with LogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS) as writer:
        writer.write('/joint_states', b'1', 1, 1)
        with pytest.raises(LogError, match="'/nowhere' has no channel"):
            writer.write('/nowhere', b'2', 2, 2)
        writer.write('/joint_states', b'3', 3, 3)
    log = read_log(tmp_path / 'run.mcap')
    assert ([message.data for message in log.messages], log.complete) == ([b'1', b'3'], True)
    with pytest.raises(LogError, match='closed'):
        writer.write('/joint_states', b'4', 4, 4)


@pytest.mark.parametrize('data, publish_time', [('text', 0), (b'', -1), (b'', 2 ** 64), (b'', None)])
@pytest.mark.parametrize('kind', [LogWriter, BackgroundLogWriter])
def test_a_message_that_cannot_be_stored_spoils_no_file(tmp_path, kind, data, publish_time):
    writer = kind(tmp_path / 'run.mcap', CHANNELS, **EXTRAS)
    writer.write('/joint_states', b'1', 1, 1)
    reason = 'message that cannot be stored'
    if kind is LogWriter:
        with pytest.raises(LogError, match=reason):
            writer.write('/joint_states', data, 2, publish_time)
        writer.write('/joint_states', b'3', 3, 3)
    else:
        writer.write('/joint_states', data, 2, publish_time)
        assert reason in str(writer.error)
    writer.close()
    log = read_log(tmp_path / 'run.mcap')
    assert ([message.data for message in log.messages], log.complete) == ([b'1', b'3'][:1 + (kind is LogWriter)], True)


def test_an_open_log_names_its_chain_and_settings(tmp_path):
    writer = LogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS)
    log = read_log(tmp_path / 'run.mcap')
    assert (log.chain_text, log.settings, log.complete, list(log.messages)) == (CHAIN_TEXT, SETTINGS, False, [])
    writer.close()


def test_a_write_flushes_when_the_period_is_over(tmp_path):
    with LogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS, flush_period=1.5) as writer:
        writer.write('/joint_states', b'1', 1, 1)
        assert list(read_log(tmp_path / 'run.mcap').messages) == []
        time.sleep(1.6)
        writer.write('/joint_states', b'2', 2, 2)
        assert [message.data for message in read_log(tmp_path / 'run.mcap').messages] == [b'1', b'2']


def test_the_last_message_before_a_silence_is_flushed_too(tmp_path):
    with BackgroundLogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS, flush_period=0.1) as writer:
        writer.write('/joint_states', b'1', 1, 1)
        deadline = time.monotonic() + 300.0   # far more than the period, for a busy machine
        while not list(read_log(tmp_path / 'run.mcap').messages):
            assert time.monotonic() < deadline
            time.sleep(0.01)


def test_what_would_be_too_old_at_the_next_look_is_flushed_now(tmp_path):
    with LogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS, flush_period=600.0) as writer:
        writer.write('/joint_states', b'1', 1, 1)
        writer.flush_when_due(1.0)
        assert writer.backlog == 1
        writer.flush_when_due(600.0)
        assert writer.backlog == 0


def test_after_a_failure_no_message_waits(tmp_path, monkeypatch):
    # What comes in while the disk fails is in a chunk that nobody will write: one who waits for it would never go on.
    def flush(mcap):
        raise OSError(ENOSPC, 'No space left on device')

    writer = LogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS, flush_period=600.0)
    messages = recorded(100)
    write(writer, messages)
    assert writer.backlog == len(messages)
    monkeypatch.setattr(McapFile, 'flush', flush)
    with pytest.raises(LogError, match='writing stopped, No space left on device'):
        writer.flush()
    assert writer.backlog == 0


def test_a_long_chunk_ends_before_it_is_old(tmp_path):
    messages = [bytes(10_000)] * 100
    with LogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS, flush_period=600.0) as writer:
        for index, data in enumerate(messages):
            writer.write('/joint_states', data, index, index)
    with open(tmp_path / 'run.mcap', 'rb') as file:
        sizes = [chunk.uncompressed_size for chunk in make_reader(file).get_summary().chunk_indexes]
    assert sum(sizes) > 1_000_000
    assert max(sizes) < 300_000   # 256 KiB and what the last message has too much


def test_every_entry_of_an_index_leads_to_its_message(tmp_path):
    written = recorded(3000)
    path = write_log(tmp_path / 'run.mcap', written, flush_period=600.0)
    chunk, times = None, []
    with open(path, 'rb') as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                chunk = record
            elif isinstance(record, MessageIndex):
                for log_time, place in record.records:
                    opcode, _, channel, _, time_there = unpack_from('<BQHIQ', chunk.data, place)
                    assert (opcode, channel, time_there) == (Opcode.MESSAGE, record.channel_id, log_time)
                    assert chunk.message_start_time <= log_time <= chunk.message_end_time
                    times.append(log_time)
    assert len(times) == len(written)
    with open(path, 'rb') as file:
        for chunk in make_reader(file).get_summary().chunk_indexes:
            assert {chunk.message_start_time, chunk.message_end_time} <= set(times)


def test_a_backlog_too_long_ends_the_log(tmp_path, monkeypatch):
    monkeypatch.setattr(log_writer, 'BACKLOG_LIMIT', 20_000)
    monkeypatch.setattr(log_writer, 'LOOK_PERIOD', 60.0)   # the disk is slow: the thread never looks
    messages = recorded(200)
    writer = BackgroundLogWriter(tmp_path / 'run.mcap', CHANNELS, **EXTRAS, flush_period=600.0)
    write(writer, messages)
    assert '0.02 MB behind' in str(writer.error)
    taken = writer.backlog
    assert 100 < taken < 200
    writer.close()
    log = read_log(tmp_path / 'run.mcap')
    assert (list(log.messages), log.complete) == (messages[:taken], True)


@pytest.mark.parametrize('seed', range(40))
def test_a_log_that_was_cut_short_is_known_whenever_that_was(seed, tmp_path):
    """Cut between two flushes or during one, and longer than before or not."""
    draw = Random(seed)
    path = tmp_path / 'run.mcap'
    writer = LogWriter(path, CHANNELS, **EXTRAS, flush_period=600.0)
    write(writer, recorded(draw.randrange(1, 400)))
    writer.flush()
    assert writer.whereabouts() == ('', False)
    write(writer, recorded(draw.randrange(400)))
    if seed % 2:
        writer._mcap.close_chunk()   # as far as a flush has come when the file is cut
    os.truncate(path, draw.randrange(path.stat().st_size))
    write(writer, recorded(draw.randrange(800)))
    writer.flush()
    assert 'cut short' in writer.whereabouts()[0]
    with pytest.warns(RuntimeWarning, match='cut short'):
        writer.close()
