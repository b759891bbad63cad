"""read_bag: the messages of a bag of rosbag2, in a file (MCAP, SQLite) or in a folder of files with metadata.yaml."""
from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
import re
import sqlite3
from typing import Iterator

import yaml

from .log_reader import LogFile, LogMessage
from .mcap_library import require_mcap
from .mcap_records import MAGIC, open_mcap
from ..errors import LogError

SQLITE = b'SQLite format 3\0'
KINDS = ('.mcap', '.db3')


@dataclass(frozen=True)
class Bag:
    """A bag: where it is, its files in order, and whether all were closed properly."""

    path: Path
    files: tuple[Path, ...]
    complete: bool

    @property
    def messages(self) -> Iterator[LogMessage]:
        """The messages, file after file, log_time being when they were received; LogError at what cannot be read."""
        for file in self.files:
            yield from _of_sqlite(file) if file.suffix == '.db3' else LogFile(file, '', {}, True).messages


def bag_files(path: Path) -> tuple[Path, ...]:
    """Return the files of a bag, which may be a file itself; LogError: it holds none, or they are compressed."""
    if not path.is_dir():
        return (path,)
    names = [file.name for file in path.iterdir() if file.suffix in KINDS]
    try:
        with open(path / 'metadata.yaml', encoding='utf-8') as stream:
            about = yaml.safe_load(stream)['rosbag2_bagfile_information']
        names = [Path(name).name for name in about['relative_file_paths']]
        compressed = about.get('compression_mode')
    except FileNotFoundError:   # the recorder was killed before it wrote this file
        compressed = ''
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError, AttributeError):
        raise LogError(f'bag {str(path)!r}: its metadata.yaml cannot be read; `ros2 bag reindex` writes a new '
                       'one') from None
    if compressed and str(compressed).lower() != 'none':
        raise LogError(f'bag {str(path)!r}: it was recorded with --compression-mode {str(compressed).lower()}, '
                       'which is not read: `ros2 bag convert` writes it without; the preset zstd_fast is read')
    if not names:
        raise LogError(f'bag {str(path)!r}: the folder holds no {" or ".join(KINDS)} file')
    return tuple(path / name for name in sorted(names, key=_in_order))


def read_bag(path) -> Bag:
    """Return the bag of a path, with its messages unread; LogError: it cannot be read."""
    path = Path(path)
    files, complete = bag_files(path), True
    for file in files:
        if file.suffix == '.db3':
            continue
        require_mcap(file)
        with open_mcap(file) as stream:
            stream.seek(-len(MAGIC), 2)
            complete = complete and stream.tell() > 0 and stream.read() == MAGIC
    return Bag(path, files, complete)


def _in_order(name: str) -> list:
    """Return a key by which bag_10 comes after bag_9."""
    return [int(part) if part.isdigit() else part for part in re.split(r'(\d+)', name)]


def _of_sqlite(path: Path) -> Iterator[LogMessage]:
    try:
        with closing(sqlite3.connect(f'{path.absolute().as_uri()}?mode=ro', uri=True)) as database:
            topics = {row[0]: row[1:] for row in database.execute('SELECT id, name, type FROM topics')}
            messages = database.execute('SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp')
            for number, time, data in messages:
                topic, type_name = topics[number]
                yield LogMessage(topic, type_name, time, time, 0, bytes(data))
    except (sqlite3.Error, KeyError, TypeError) as error:
        raise LogError(f'bag {str(path)!r}: it cannot be read as a bag of SQLite ({error})') from None
