"""Every command and every Python block of the documents is run, in order, page by page, in a folder of its own."""
from collections import Counter
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO
import os
from pathlib import Path
import re
import shlex
import shutil
import signal
import subprocess
import sys
from threading import Thread
from time import monotonic, sleep
from xml.etree import ElementTree

from blocks import blocks_of, MISSING, PAGES, ROOT
import pytest
import yaml

import planar_chain_sim as pcs
from planar_chain_sim.chain import checks
from planar_chain_sim.executables import MODULES

PATIENCE = 300.0    # s
NOT_RUN = {        # what cannot be run here, and how many blocks
    'needs ROS 2 from apt': 7,
    'needs PlotJuggler': 1,
    'takes some minutes': 1,
    'the test runs in the environment that these two make': 1,
    'takes more than a minute, and needs the extra [benchmark]': 1,
    'these build an environment, run the tests themselves, or take long': 1,
    'what a file of somebody else would give': 1,
}
# What runs until Ctrl-C, and the line by which it is known to run; None: known by efforts of the arm.
ENDLESS = {'simulator': 'running', 'example_controller': 'largest error', 'replay': 'replaying',
           'view': 'the arm is at', 'python controller.py': None}
EXECUTABLES = {**dict(re.findall(r"f'(\w+) = \{NAME\}\.([\w.]+):main'", (ROOT / 'setup.py').read_text())), **MODULES}


def title(page: Path) -> str:
    """Return the page's place in the project."""
    return str(page.relative_to(ROOT))


class Terminal:
    """A command under way, with its output, stopped as by Ctrl-C."""

    def __init__(self, command: str, folder: Path, environment: dict):
        self.command, self.lines = command, []
        self._popen = subprocess.Popen(['bash', '-c', command], cwd=folder, env=environment, text=True,
                                       stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True)
        self._reader = Thread(target=lambda: self.lines.extend(self._popen.stdout), daemon=True)
        self._reader.start()

    @property
    def output(self) -> str:
        return ''.join(self.lines)

    def wait_for(self, text: str) -> None:
        end = monotonic() + PATIENCE
        while not any(text in line for line in self.lines):
            assert self._popen.poll() is None and monotonic() < end, f'{self.command}: no {text!r} in {self.output}'
            sleep(0.01)

    def finish(self) -> int:
        code = self._popen.wait(PATIENCE)
        self._reader.join(PATIENCE)
        return code

    def stop(self) -> int:
        os.killpg(self._popen.pid, signal.SIGINT)
        return self.finish()

    def kill(self) -> None:
        if self._popen.poll() is None:
            os.killpg(self._popen.pid, signal.SIGKILL)


class Reader:
    """A reader who follows a page and types its commands."""

    def __init__(self, folder: Path, tools: Path):
        self.folder, self.names, self.output, self.before = folder, {}, None, []
        for name in ('README.md', 'config', 'docs', 'examples', 'launch'):
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, folder / name)
        if Path(sys.prefix, 'bin/activate').exists():
            (folder / '.venv').symlink_to(sys.prefix)
        self.environment = {**os.environ, 'PATH': os.pathsep.join([str(tools), os.environ['PATH']]),
                            'PYTHONPATH': os.pathsep.join(sys.path), 'PYTHONUNBUFFERED': '1'}

    def follow(self, block) -> None:
        if block.file:
            (self.folder / block.file).write_text(block.text)
        elif block.language == 'bash':
            self.type(block)
        elif block.language == 'python':
            printed = StringIO()
            with redirect_stdout(printed):
                exec(compile(block.text, str(block), 'exec'), self.names)
            self.output = printed.getvalue()
        elif block.language == 'text' and self.output is not None:   # before anything has been run it is a drawing
            self.compare(block)
        elif block.language == 'yaml':
            assert yaml.safe_load(block.text), block

    def type(self, block) -> None:
        """Run the commands of a block; those of several terminals at the same time."""
        running = {}
        try:
            for terminal, command in block.commands:
                if command.startswith(('source ', 'export ')):
                    self.before.append(command)
                    continue
                if terminal in running:   # one command after the other in each terminal
                    self.end(running.pop(terminal), block)
                started = running[terminal] = Terminal(' && '.join([*self.before, f'exec {command}']), self.folder,
                                                       self.environment)
                self.see(started, command)
                if terminal == 0:
                    self.end(running.pop(terminal), block)
            for terminal in sorted(running, reverse=True):
                self.end(running.pop(terminal), block)
        finally:
            for started in running.values():
                started.kill()

    def see(self, started, command: str) -> None:
        """Wait until the command is seen to work, or has ended."""
        started.endless = next((name for name in ENDLESS if command.startswith(name) and '--help' not in command), None)
        if started.endless is None:
            self.output = ''
            assert started.finish() == 0, f'{command}: {started.output}'
            self.output = started.output
        elif ENDLESS[started.endless]:
            started.wait_for(ENDLESS[started.endless])
        else:
            wait_for_efforts()

    def end(self, started, block) -> None:
        if started.endless is not None:
            assert 'Traceback' not in started.output, started.output
            code = started.stop()
            if not started.endless.startswith('python '):   # a reader's own file may end with rclpy's traceback
                assert code == 0 and 'Traceback' not in started.output, f'{block}: {started.command}: {started.output}'

    def compare(self, block) -> None:
        """Find the lines of a text block in the last output, in order and without gaps except at `...`."""
        found = [line.rstrip() for line in self.output.splitlines()]
        place = None
        for line in map(str.rstrip, block.text.splitlines()):
            if line.strip() == '...':
                place = None
            elif place is None:
                assert line in found, f'{block}: {line!r} is not in {self.output}'
                place = found.index(line) + 1
            else:
                assert place < len(found) and found[place] == line, f'{block}: {line!r}, not {found[place:place + 1]}'
                place += 1


def wait_for_efforts() -> None:
    """Wait for a state with efforts that are not zero."""
    from rclpy import Context, init
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from rclpy.signals import SignalHandlerOptions
    from sensor_msgs.msg import JointState
    context = Context()
    init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node, states = Node('reader', context=context), []
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    node.create_subscription(JointState, 'joint_states', states.append, 10)
    end = monotonic() + PATIENCE
    try:
        while not (states and any(states[-1].effort)):
            assert monotonic() < end, 'no efforts have come'
            executor.spin_once(timeout_sec=0.1)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


@pytest.fixture(scope='module')
def tools(tmp_path_factory):
    """Return a folder with the executables, as pip would make them of these sources, and `python`."""
    folder = tmp_path_factory.mktemp('bin')
    scripts = {name: f'-c "import sys; from planar_chain_sim.{module} import main; sys.argv[0] = {name!r}; '
                     f'sys.exit(main())"' for name, module in EXECUTABLES.items()}
    for name, arguments in {**scripts, 'python': ''}.items():
        (folder / name).write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} {arguments} "$@"\n')
        (folder / name).chmod(0o755)
    return folder


def run_page(page, tmp_path, tools, monkeypatch):
    monkeypatch.chdir(tmp_path)
    reader = Reader(tmp_path, tools)
    for block in blocks_of(page):
        if not block.untested:
            reader.follow(block)


def needs_ros(page) -> bool:
    return any(command.startswith(tuple(ENDLESS)) and '--help' not in command for block in blocks_of(page)
               if block.language == 'bash' and not block.untested for _, command in block.commands)


@pytest.mark.slow
@pytest.mark.parametrize('page', [page for page in PAGES if not needs_ros(page)], ids=title)
def test_what_a_page_says_works(page, tmp_path, tools, monkeypatch):
    run_page(page, tmp_path, tools, monkeypatch)


@pytest.mark.ros
@pytest.mark.parametrize('page', [page for page in PAGES if needs_ros(page)], ids=title)
def test_what_a_page_says_works_with_nodes(page, tmp_path, tools, monkeypatch):
    pytest.importorskip('rclpy')
    run_page(page, tmp_path, tools, monkeypatch)


def test_no_page_writes_the_file_of_another():
    """Whoever follows all pages in one folder is never told that a file exists and is not overwritten."""
    new = re.compile(r"(?:--output |record:=|OfflineLog\(')([\w./]+)")
    written = Counter(name for page in PAGES for block in blocks_of(page) if not block.untested
                      for name in new.findall(block.text))
    assert len(written) > 10 and not [name for name, times in written.items() if times > 1], written


def test_blocks_that_are_not_run_are_counted():
    counted = Counter(block.untested for page in PAGES for block in blocks_of(page)
                      if block.untested not in ('', MISSING))
    assert counted == NOT_RUN


def test_an_unknown_fence_is_refused(tmp_path):
    for fence in ('', 'sh', 'bash untested', 'console untested: why'):
        (tmp_path / 'page.md').write_text(f'Text.\n\n```{fence}\nls\n```\n')
        with pytest.raises(ValueError, match='page.md, line 3: the fence says'):
            blocks_of(tmp_path / 'page.md')


def test_the_readme_is_short():
    assert len((ROOT / 'README.md').read_text().splitlines()) <= 200


def slug(heading: str) -> str:
    """Return the anchor that GitHub gives a heading."""
    return re.sub(r'[^\w\- ]', '', heading.strip().lower()).replace(' ', '-')


@pytest.mark.parametrize('page', PAGES, ids=title)
def test_links_lead_somewhere(page):
    text = re.sub(r'```.*?```', '', page.read_text(), flags=re.DOTALL)
    for link in re.findall(r'\]\(([^)\s]+)\)', text):
        if link.startswith(('http:', 'https:')):
            continue
        name, _, anchor = link.partition('#')
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), f'{title(page)}: {link}'
        if anchor:
            headings = re.findall(r'^#+ (.*)$', target.read_text(), re.MULTILINE)
            assert anchor in map(slug, headings), f'{title(page)}: {link}'


def inline_commands():
    """Yield (page, words) of what stands in the text as code and begins with the name of one of our executables."""
    for page in PAGES:
        text = re.sub(r'```.*?```', '', page.read_text(), flags=re.DOTALL)
        for code in re.findall(r'`([^`\n]+)`', text):
            words = code.split()
            if words[0] in EXECUTABLES:
                yield page, words


def test_options_in_the_text_exist():
    help_of, seen = {}, 0
    for page, words in inline_commands():
        for option in (word.partition('=')[0] for word in words if word.startswith('--') and word != '--ros-args'):
            if words[0] not in help_of:
                printed = StringIO()
                with redirect_stdout(printed), pytest.raises(SystemExit):
                    import_module(f'planar_chain_sim.{EXECUTABLES[words[0]]}').main(['--help'])
                help_of[words[0]] = re.findall(r'--[\w-]+', printed.getvalue())
            assert option in help_of[words[0]], f'{page.name}: {" ".join(words)}'
            seen += 1
    assert seen


def ros_commands():
    """Yield (page, words) of every command of the command line tool ros2, in blocks and in the text."""
    for page in PAGES:
        lines = [command for block in blocks_of(page) if block.language == 'bash' for _, command in block.commands]
        lines += re.findall(r'`(ros2 [^`\n]+)`', page.read_text())
        yield from ((page, shlex.split(line, comments=True)) for line in lines if line.startswith('ros2 '))


@pytest.mark.ros
def test_commands_of_ros2_name_what_there_is():
    """Without that tool itself: executables, launch files and their arguments, topics with types and data."""
    pytest.importorskip('rclpy')
    from planar_chain_sim.ros.messages import INPUTS
    from planar_chain_sim.ros.parameters import PARAMETERS
    topics = {topic.name.replace('~', '/simulator'): topic for topic in INPUTS.values()}
    parameters = {row.name for row in (PARAMETERS.values() if isinstance(PARAMETERS, dict) else PARAMETERS)}
    seen = Counter()
    for page, words in ros_commands():
        kind = ' '.join(words[1:3]) if words[1] in ('topic', 'param') else words[1]
        if kind == 'run':
            assert words[2] == 'planar_chain_sim' and words[3] in EXECUTABLES, page
        elif kind == 'launch':
            assert words[2] == 'planar_chain_sim', page
            text = (ROOT / 'launch' / words[3]).read_text()
            assert all(f"'{argument.partition(':=')[0]}'" in text for argument in words[4:]), page
        elif kind == 'topic pub' and len(words) > 4:
            name, type_name, data = words[-3:]
            assert topics[name].type_name == type_name, page
            put(topics[name].message(), yaml.safe_load(data))
        elif kind == 'param set' and len(words) > 4:
            assert words[3] == '/simulator' and words[4] in parameters, page
        seen[kind] += 1
    assert min(seen['run'], seen['launch'], seen['topic pub'], seen['param set']) > 0, seen


def put(message, data: dict) -> None:
    """Put the fields of a message; AttributeError or AssertionError: no such field, another type."""
    for key, value in data.items():
        if isinstance(value, dict):
            put(getattr(message, key), value)
        else:
            old = getattr(message, key)
            setattr(message, key, [float(each) for each in value] if isinstance(value, list) else type(old)(value))


def table_below(page: str, heading: str) -> list:
    """Return the first column of the table below a heading, names in code."""
    section = (ROOT / page).read_text().split(f'\n{heading}\n', 1)[1].split('\n## ')[0]
    rows = re.findall(r'^\| (`.*?) \|', section, re.MULTILINE)
    return [name for row in rows for name in re.findall(r'`(\w+)', row)]


def test_the_chain_file_page_has_every_key():
    assert table_below('docs/chain_file.md', '## Keys of the file') == list(checks.CHAIN_KEYS)
    assert table_below('docs/chain_file.md', '## Keys of a body') == list(checks.BODY_KEYS)
    assert table_below('docs/chain_file.md', '## Keys of a joint') == list(checks.JOINT_KEYS)


def test_every_shipped_chain_has_its_picture():
    page = (ROOT / 'docs/chain_file.md').read_text()
    for path in (ROOT / 'config').glob('*.yaml'):
        assert f'**`{path.name}`**' in page and f'({path.stem}.png)' in page, path.name


def test_every_executable_is_in_the_readme():
    assert sorted(table_below('README.md', '## Commands')) == sorted(EXECUTABLES)


def test_every_method_is_in_the_table():
    assert set(table_below('docs/python.md', '## Methods')) == {'auto', *pcs.METHODS}


def test_public_names_are_in_the_documents():
    text = ''.join(page.read_text() for page in PAGES)
    assert not [name for name in pcs.__all__ if not re.search(rf'\b{name}\b', text)]


def test_the_version_has_its_changes():
    version = ElementTree.parse(ROOT / 'package.xml').getroot().findtext('version')
    assert f'\n## {version}\n' in (ROOT / 'CHANGELOG.md').read_text()
