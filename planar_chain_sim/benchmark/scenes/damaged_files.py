"""Chain files with random damage, read in a process of their own: `python -m ... N` prints what it found as JSON."""
from __future__ import annotations

import json
from pathlib import Path
import random
import subprocess
import sys
from time import process_time
from typing import Iterator, Optional

from . import Check
from ...chain_file import chain_from_text, find_chain_file
from ...errors import ChainError


def chain_files(peers: dict, size: float) -> Iterator[Check]:
    """Read damaged chain files: a chain or one sentence, soon, in little memory, and the process lives."""
    count = int(1e5 * size)
    process = subprocess.run([sys.executable, '-m', __name__, str(count)], stdout=subprocess.PIPE)
    crashed = process.returncode != 0
    broken, longest, grown = (count, None, None) if crashed else json.loads(process.stdout)
    yield Check(f'{count} damaged files: neither a chain nor one sentence', 0, broken)
    why = 'the process crashed' if crashed else 'there is no /proc'
    yield Check('longest CPU time of one of them, s', 10.0, longest, why=why)
    yield Check('growth of the largest memory after the first tenth, MB', 64.0, grown, why=why)


def read_damaged(count: int) -> tuple[int, float, Optional[float]]:
    """Return how many of `count` damaged texts give neither chain nor sentence, longest CPU time, s, and MB added."""
    pick = random.Random(7)
    texts = [find_chain_file(name).read_text() for name in ('four_link_robot.yaml', 'cart_arm_telescope.yaml')]
    broken, longest, at_first = 0, 0.0, None
    for k in range(count):
        text = _monster(pick) if k % 200 == 100 else _damaged(pick, texts)
        if k == count // 10:
            at_first = _largest_memory()
        began = process_time()
        try:
            chain_from_text(text, 'fuzzed.yaml')
        except ChainError as error:
            broken += '\n' in str(error)
        except Exception:   # what must not be
            broken += 1
        longest = max(longest, process_time() - began)
    return broken, longest, None if at_first is None else _largest_memory() - at_first


def _damaged(pick: random.Random, texts: list) -> str:
    tokens = ['nan', '-1e400', '[', ']', '{', ': ', '\n', '  ', '- ', '&a', '*a', '0x', "'", '"', '\t', '!!binary ',
              'null', '1e308', '-0.0', '\u2028', 'mass', 'carrier', '~', '|', '<<: ', '5e-324', '-', '.inf', '\ud800']
    text = pick.choice(texts)
    for _ in range(pick.randint(1, 4)):
        at, cut = pick.randrange(len(text)), pick.choice((0, 0, 1, 5, 40))
        text = text[:at] + pick.choice(tokens) + text[at + cut:]
    return text


def _monster(pick: random.Random) -> str:
    """Return a text that is small to write and large to read."""
    many = 10**pick.randint(1, 5)
    aliases = ''.join(f'a{k}: &a{k} [{", ".join([f"*a{k - 1}"] * 9)}]\n' for k in range(1, 12))
    return pick.choice((
        '[' * many, '{a: ' * many, 'name: x\n' + ''.join(' ' * k + 'a:\n' for k in range(min(many, 300))), '- ' * many,
        'a0: &a0 [x, x]\n' + aliases, 'name: ' + 'x' * many, f'gravity: [{"9" * many}, 0]',
        'bodies: [' + '1, ' * many + ']',
        'bodies:\n' + '  - name: b\n' * many, '? ' * many, '"' + '\\u0041' * many, '!!python/object:os.system ' * many))


def _largest_memory() -> Optional[float]:
    """Return the largest resident memory of this process so far, MB: proc(5), VmHWM; None where there is no /proc."""
    try:
        line = next(line for line in Path('/proc/self/status').read_text().splitlines() if line.startswith('VmHWM'))
    except (OSError, StopIteration):
        return None
    return int(line.split()[1]) * 1024e-6


if __name__ == '__main__':
    print(json.dumps(read_damaged(int(sys.argv[1]))))
