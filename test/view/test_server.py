"""The server of the page: who may speak to it, what it answers, and that no page can disturb it."""
import asyncio
import http.client
import signal
import socket
from urllib.parse import urlsplit

import numpy as np
from pages import Page, until, View
import pytest

import planar_chain_sim as pcs

SOCKET = {'Connection': 'Upgrade', 'Upgrade': 'websocket', 'Sec-WebSocket-Version': '13',
          'Sec-WebSocket-Key': 'AAAAAAAAAAAAAAAAAAAAAA=='}


@pytest.fixture(scope='module')
def address():
    """Return the address of a page that shows the double pendulum."""
    with View('double_pendulum.yaml', '--port', '0') as view:
        yield view.address
        view.stop()


def get(address, path='', host=None, **headers):
    """Return status and text of a GET, whose Host is `host` where one is given."""
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=600)
    connection.putrequest('GET', parts.path + path, skip_host=True)
    for name, value in {'Host': host or parts.netloc, **headers}.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    found = answer.status, '' if answer.status == 101 else answer.read().decode()
    connection.close()
    return found


def test_the_page_comes_with_a_policy_that_locks_it_in(address):
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=600)
    connection.request('GET', '/')
    answer = connection.getresponse()
    policy = answer.headers['Content-Security-Policy']
    assert answer.status == 200 and "default-src 'none'" in policy and "script-src 'self'" in policy
    assert 'unsafe' not in policy and "frame-ancestors 'none'" in policy
    connection.close()
    assert get(address, 'main.js')[0] == 200
    for path in ('nothing.js', '../server.py', '%2e%2e/server.py', '/etc/passwd', 'page/main.js'):
        assert get(address, path)[0] == 404, path


@pytest.mark.parametrize('path', ['', 'main.js', 'socket'])
def test_a_foreign_host_is_refused(address, path):
    """As after DNS rebinding: a name of somebody else leads here."""
    port = urlsplit(address).port
    for host in ('evil.example', f'evil.example:{port}', f'127.0.0.1.evil.example:{port}', 'localhost@evil.example',
                 '[::2]', '0.0.0.0', 'a b', f'127.0.0.1:{port}:1'):
        assert get(address, path, host, Origin=f'http://{host}', **SOCKET)[0] in (400, 403), host
    assert get(address, path, f'localhost:{port}')[0] == (200 if path != 'socket' else 403)


def test_a_foreign_origin_is_refused(address):
    own = address.rstrip('/')
    assert get(address, 'socket', Origin=own, **SOCKET)[0] == 101
    for origin in ('http://evil.example', 'null', own.replace('http', 'https'), 'http://127.0.0.1:1',
                   own.replace('127.0.0.1', 'localhost')):
        assert get(address, 'socket', Origin=origin, **SOCKET)[0] == 403, origin
        assert get(address, Origin=origin)[0] == 403, origin
    assert get(address, 'socket', **SOCKET)[0] == 403, 'no Origin'


def test_beyond_this_machine_the_token_is_needed():
    with View('double_pendulum.yaml', '--host', '0.0.0.0', '--port', '0') as view:
        parts = urlsplit(view.address)
        address, token = f'http://127.0.0.1:{parts.port}/', parts.path.strip('/')
        assert len(token) > 20
        for path in ('', 'main.js', 'socket', token[:-1], f'{token[:-1]}x/', 'x/main.js'):
            assert get(address, path, Origin=address.rstrip('/'), **SOCKET)[0] == 403, path
        assert get(address, f'{token}/')[0] == 200 and get(address, f'{token}/main.js')[0] == 200
        assert get(address, f'{token}/', 'evil.example')[0] == 403
        assert get(address, f'{token}/socket', Origin=address.rstrip('/'), **SOCKET)[0] == 101
        view.stop()


def test_a_frame_has_the_arm_as_the_chain_has_it(address):
    chain = pcs.load_chain('double_pendulum.yaml')

    async def look():
        async with Page(address) as page:
            return await page.until(lambda arm: arm['head'][1] > 100), page.scene
    arm, (scene,) = asyncio.run(look())
    assert [joint['name'] for joint in scene['joints']] == list(chain.joint_names)
    assert [body['name'] for body in scene['bodies']] == [body.name for body in chain.bodies]
    poses = pcs.body_poses(chain, arm['position'])
    np.testing.assert_array_equal(arm['bodies'][:, :2], poses.point)
    np.testing.assert_array_equal(arm['bodies'][:, 2], poses.angle)
    np.testing.assert_array_equal(arm['bodies'][:, 3:5], poses.center_of_mass)
    np.testing.assert_array_equal(arm['head'][2:4], pcs.energy(chain, arm['position'], arm['velocity']))
    turned = arm['zeros'][:, 2] + [joint['axis'] for joint in scene['joints']] * arm['position']
    np.testing.assert_allclose(turned, poses.angle, rtol=0, atol=1e-14)   # sums in another order
    simulation = pcs.Simulation(chain)
    simulation.advance(int(arm['head'][1]))
    np.testing.assert_array_equal(arm['position'], simulation.position)   # nothing was held: the same bits


ODD = ['', 'x', '[]', '{}', '1', 'null', '{"do": 3}', '{"do": "fly"}', '{"do": "pause"}', '{"do": "pause", "value": 1}',
       '{"do": "effort", "joint": "nothing", "value": 1}', '{"do": "effort", "joint": 1, "value": 1}',
       '{"do": "effort", "joint": "upper_joint", "value": NaN}',
       '{"do": "effort", "joint": "upper_joint", "value": 1e999}',
       '{"do": "pull", "body": "upper_rod", "point": [0], "to": [1, 1]}',
       '{"do": "pull", "body": "nothing", "point": [0, 0], "to": [1, 1]}',
       '{"do": "set", "name": "gravity", "value": [1]}', '{"do": "set", "name": "gravity", "value": 1}',
       '{"do": "set", "name": "chain_file", "value": 1}', '{"do": "set", "name": "damping", "value": [-1, 0]}',
       '{"do": "set", "name": "real_time_factor", "value": -1}', '{"do": "set", "name": "payload_mass", "value": -1}',
       '{"do": "step"}', 500 * '[', '{"do": "frame", "time": "now"}']


def test_odd_messages_are_refused_with_a_sentence_and_the_page_goes_on(address):
    async def talk():
        async with Page(address) as page, Page(address) as other:
            for text in ODD:
                before = len(page.refused)
                await page.socket.send_str(text)
                assert await page.frame(), text
                assert len(page.refused) == before + 1 and page.refused[-1], text
            assert not [sentence for sentence in page.refused if 'Traceback' in sentence]
            await page.socket.send_str(5000 * ' ')   # longer than any action
            with pytest.raises((AssertionError, ConnectionError)):
                await page.frame()
            assert await other.frame() and not other.refused
    asyncio.run(talk())


def test_what_a_page_holds_goes_with_it(address):
    """Let go, closed in the midst, or hanging: the page that says nothing any more has let go."""
    async def talk():
        async with Page(address) as watcher:
            def pulled(arm):
                return arm['bodies'][1, 5:].any()

            def pushed(arm):
                return arm['effort'][0] == 3.0

            def let_go(arm):
                return not pulled(arm) and arm['effort'][0] == 0.0
            for end in ('release', 'close', 'hang'):
                async with Page(address) as page:
                    place = {'body': 'lower_rod', 'point': [0.5, 0.0], 'to': [2.0, 2.0]}
                    await page.until(pulled, 'pull', **place)
                    await page.until(pushed, 'effort', joint='upper_joint', value=3.0)
                    if end == 'release':
                        await page.say('release')
                    if end == 'hang':   # it still looks, which keeps the connection, and says nothing more of the pull
                        await page.until(let_go)
                    elif end == 'release':
                        await watcher.until(let_go)
                await watcher.until(let_go)
    asyncio.run(talk())


def test_the_end_waits_for_no_page():
    """Pages that read nothing, one in the midst of a request: SIGTERM ends the program with 0."""
    with View('double_pendulum.yaml', '--port', '0') as view:
        parts = urlsplit(view.address)
        hung = [socket.create_connection((parts.hostname, parts.port)) for _ in range(3)]
        for one in hung[:2]:
            lines = [f'GET /socket HTTP/1.1\r\nHost: {parts.netloc}\r\nOrigin: http://{parts.netloc}\r\n']
            one.sendall(''.join(lines + [f'{key}: {value}\r\n' for key, value in SOCKET.items()] + ['\r\n']).encode())
            assert b'101' in one.recv(4096)
        hung[2].sendall(b'GET / HT')
        assert view.end(signal.SIGTERM) == 0, view.lines
        for one in hung:
            one.close()
    assert len(view.lines) == 1


def test_what_is_no_http_gets_its_answer_and_the_terminal_stays_clean():
    """As from a scanner, or a browser that tries https."""
    with View('double_pendulum.yaml', '--port', '0') as view:
        parts = urlsplit(view.address)
        for text in (b'GET / HTTP/1.1\r\n\r\n', b'GET / HTTP/1.1\r\nHost: ' + 9000 * b'a' + b'\r\n\r\n',
                     b'GET / HTTP/1.1\r\nHost: a\r\nContent-Length: x\r\n\r\n', b'\x16\x03\x01\x02\x00\r\n\r\n'):
            with socket.create_connection((parts.hostname, parts.port)) as one:
                one.sendall(text)
                assert b' 400 ' in one.recv(4096), text
        assert get(view.address)[0] == 200
        view.stop()
    assert len(view.lines) == 1, view.lines


def test_an_empty_host_is_refused():
    """It would be all addresses, of which the printed one is none."""
    with View('double_pendulum.yaml', '--host', '', '--port', '0') as view:
        assert view.end() == 2
    assert view.lines == ["view: host is '', must be an address of this machine, 0.0.0.0 for all that it has"]


def test_a_port_in_use_is_one_sentence(address):
    port = urlsplit(address).port
    with View('double_pendulum.yaml', '--port', port) as view:
        assert view.end() == 2
    assert view.lines == [f'view: port {port} is in use, give another one with --port, 0 for any']
    with socket.socket() as taken:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)   # as when old connections linger
        try:
            taken.bind(('127.0.0.1', 8080))
            taken.listen()
        except OSError:
            pass   # somebody else has it, which is as good
        with View('double_pendulum.yaml') as view:
            assert urlsplit(view.address).port != 8080
            assert view.lines[0] == 'view: port 8080 is in use, so the page has another one'
            view.stop()


TEXT = """name: rod
bodies:
  - name: rod
    carrier: base
    mass: 1.0
    center_of_mass: [0.5, 0.0]
    inertia: 0.4
    rotation: {{joint: hinge, position: {position}, damping: {damping}}}
"""


def test_changes_of_the_chain_file_are_followed(tmp_path):
    file = tmp_path / 'rod.yaml'
    file.write_text(TEXT.format(position=0.5, damping=0.1))

    async def talk(address):
        async with Page(address) as page:
            before = await page.until(lambda arm: arm['head'][1] > 200)
            file.write_text(TEXT.format(position=0.5, damping=0.2))        # goes on from where it is
            await page.until(lambda arm: page.status['values']['damping'] == [0.2])
            assert not page.status['fault'] and before['position'][0] < 0.5
            file.write_text(TEXT.format(position=0.5, damping='heavy'))    # the arm stays, and the sentence comes
            await page.until(lambda arm: page.status['fault'])
            assert 'rod.yaml' in page.status['sentence'] and "'heavy'" in page.status['sentence']
            assert page.status['values']['damping'] == [0.2]
            file.write_text(TEXT.replace('- name: rod', '- name: bar').format(position=2.5, damping=0.3))
            await page.until(lambda arm: page.scene[0]['bodies'][0]['name'] == 'bar')
            assert not page.status['fault']
            arm = await page.until(lambda arm: arm['head'][1] > 0)
            assert arm['position'][0] > 0.5   # from the new initial state, towards the bottom on the other side
            file.unlink()
            await page.until(lambda arm: 'cannot be read' in page.status['sentence'])
    with View(file, '--port', '0') as view:
        asyncio.run(talk(view.address))
        view.stop()


def test_a_browser_at_the_port_needs_no_patience(address):
    """Pages come and go while others look: none waits for another one."""
    async def look():
        pages = [Page(address) for _ in range(10)]
        for page in pages:
            await page.__aenter__()
        counts = await asyncio.gather(*(count(page) for page in pages))
        for page in pages:
            await page.__aexit__()
        return counts

    async def count(page):
        return sum([bool(await page.frame()) for _ in range(20)])
    assert asyncio.run(look()) == 10 * [20]
    assert until(lambda: get(address)[0] == 200)
