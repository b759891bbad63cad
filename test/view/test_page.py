"""The page itself: its looks at three widths, its themes, foreign text on it, and a connection that is lost."""
from itertools import combinations
import random
import signal

from pages import until, View
import pytest
from screen import Screen
from selenium.webdriver import ActionChains

import planar_chain_sim as pcs

pytestmark = pytest.mark.slow

SIZES = ((360, 740), (1280, 800), (2560, 1440))
EVIL = '<img src="x" onerror="window.evil = 1">'
RODS = f"""name: 'rods {EVIL}'
bodies:
  - name: 'rod {EVIL}'
    carrier: base
    mass: 1.0
    center_of_mass: [0.5, 0.0]
    inertia: 0.4
    rotation: {{joint: 'hinge {EVIL}', position: 0.5, lower: 0.4, upper: 1.0}}
"""


@pytest.fixture(scope='module')
def view():
    with View('four_link_robot.yaml', '--port', '0') as view:
        yield view
        view.stop()


@pytest.fixture
def screen(browser, view):
    shown = Screen(browser, view.address)
    yield shown
    for command in ('Emulation.clearDeviceMetricsOverride', 'Emulation.setEmulatedMedia'):
        browser.execute_cdp_cmd(command, {})
    shown('localStorage.clear()')
    browser.get('about:blank')


PLACES = """
return ['header', '#stage', '#run', '#joints', '#charts', '#settings', '#events'].map((name) => {
  const {left, right, top, bottom} = document.querySelector(name).getBoundingClientRect();
  return [name, left, right, top, bottom];
});
"""
NAMELESS = """
return [...document.querySelectorAll('button, select, input, canvas, dialog')].filter((each) =>
  !each.closest('[aria-hidden=true]') && !each.labels?.length && !each.ariaLabel &&
  !(each.matches('button') && each.textContent.trim()) && !each.getAttribute('aria-labelledby'))
  .map((each) => each.outerHTML);
"""
COLORS = """
const style = getComputedStyle(document.documentElement);
return Object.fromEntries(['paper', 'panel', 'ink', 'faint', 'accent', 'fault'].map((name) =>
  [name, style.getPropertyValue(`--${name}`).trim()]));
"""


def luminance(color):
    parts = [int(color[k:k + 2], 16) / 255 for k in (1, 3, 5)]
    parts = [part / 12.92 if part <= 0.03928 else ((part + 0.055) / 1.055)**2.4 for part in parts]
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_looks(screen, browser, scheme):
    """At a phone's, a laptop's and a wall's width: nothing sticks out or overlaps, all is named, text has contrast."""
    browser.execute_cdp_cmd('Emulation.setEmulatedMedia', {
        'features': [{'name': 'prefers-color-scheme', 'value': scheme}]})
    for width, height in SIZES:
        browser.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
            'width': width, 'height': height, 'deviceScaleFactor': 2 if width == 360 else 1, 'mobile': False})
        until(lambda: screen('return view.camera.width === document.getElementById("arm").clientWidth'))
        assert screen('return document.documentElement.scrollWidth <= innerWidth && innerWidth') == width
        for (one, *a), (other, *b) in combinations(screen(PLACES), 2):
            apart = a[1] <= b[0] + 1 or b[1] <= a[0] + 1 or a[3] <= b[2] + 1 or b[3] <= a[2] + 1
            assert apart, (one, other, width)
        assert screen('return document.getElementById("arm").clientHeight') > 200
        assert screen(NAMELESS) == []
    colors = screen(COLORS)
    assert (luminance(colors['paper']) > 0.5) is (scheme == 'light')
    for text in ('ink', 'faint', 'accent', 'fault'):
        for ground in ('paper', 'panel'):
            light, dark = sorted([luminance(colors[text]), luminance(colors[ground])], reverse=True)
            assert (light + 0.05) / (dark + 0.05) >= 4.5, (text, ground)   # WCAG AA
    assert screen.errors() == []


def test_the_theme_that_is_chosen_is_kept(screen, browser):
    browser.execute_cdp_cmd('Emulation.setEmulatedMedia', {
        'features': [{'name': 'prefers-color-scheme', 'value': 'light'}]})
    assert luminance(screen(COLORS)['paper']) > 0.5
    screen.click('theme')
    until(lambda: luminance(screen(COLORS)['paper']) < 0.5)
    browser.refresh()
    until(lambda: screen('return window.view && view.frames > 0'))
    assert luminance(screen(COLORS)['paper']) < 0.5


def test_keys(screen):
    def press(*keys):
        ActionChains(screen.browser).send_keys(*keys).perform()
    press(' ')
    until(lambda: screen('return view.status.paused'))
    tick = until(lambda: screen('return view.arms[0].tick'))
    press('.')
    until(lambda: screen('return view.arms[0].tick') > tick)
    press('?')
    assert screen('return document.getElementById("keys").open') and 'pause' in screen(
        'return document.getElementById("keys").textContent')
    screen('document.getElementById("keys").close()')
    press(']', ']')
    assert screen('return document.querySelector("#joints .chosen .name").textContent') == 'column_joint'
    press(' ')
    until(lambda: not screen('return view.status.paused'))
    ActionChains(screen.browser).key_down('\ue013').perform()   # up
    until(lambda: screen('return view.arms[0].effort[1]') > 0)
    ActionChains(screen.browser).key_up('\ue013').perform()
    until(lambda: screen('return view.arms[0].effort[1]') == 0)
    press('r')
    assert screen.errors() == []


def test_text_of_chains_and_logs_stays_text(browser, tmp_path):
    (tmp_path / 'rods.yaml').write_text(RODS)
    with pcs.OfflineLog(tmp_path / f'{EVIL}.mcap'.replace('/', ''), pcs.Simulation(
            pcs.load_chain(tmp_path / 'rods.yaml'))) as log:
        log.advance(2000)
    for path in tmp_path.iterdir():
        with View(path, '--port', '0') as view:
            screen = Screen(browser, view.address)
            until(lambda: EVIL in screen('return document.querySelector("#event-list").textContent'))
            assert screen('return document.querySelectorAll("img").length') == 0
            assert screen('return window.evil') is None
            for place in ('#joints', '#legend', '#trail', 'title', '#name'):
                assert EVIL in screen('return document.querySelector(arguments[0]).textContent', place), place
            assert screen.errors() == []
            browser.get('about:blank')
            view.stop()


def start(port=None):
    """Start view at a port that no system gives to others by itself."""
    while True:
        chosen = port or random.randrange(20_000, 32_000)
        view = View('double_pendulum.yaml' if port else 'four_link_robot.yaml', '--port', chosen)
        until(lambda: view.lines or view.popen.poll() is not None)
        if port or view.popen.poll() is None:
            return view, chosen
        view.end()


def test_a_lost_connection_is_said_and_found_again(browser):
    view, port = start()
    with view:
        screen = Screen(browser, view.address)
        view.popen.send_signal(signal.SIGSTOP)
        until(lambda: screen('return document.body.className').find('lost') >= 0)
        assert 'does not answer' in screen('return document.getElementById("sentence").textContent')
        view.popen.send_signal(signal.SIGCONT)
        until(lambda: 'lost' not in screen('return document.body.className'))
        assert screen('return document.getElementById("sentence").textContent') == 'running'
        view.stop()
    until(lambda: 'no connection' in screen('return document.getElementById("sentence").textContent'))
    assert screen('return [view.scene, view.arms, view.status]') == [None, None, None]
    assert screen('return document.getElementById("pause").disabled')
    view, _ = start(port)
    with view:
        until(lambda: screen('return view.arms !== null'))
        assert screen('return document.getElementById("name").textContent') == 'double_pendulum'
        assert 'lost' not in screen('return document.body.className')
        assert len(screen('return [...view.arms[0].position]')) == 2
        browser.get('about:blank')
        view.stop()
    screen.errors()   # of the connection that could not be made
