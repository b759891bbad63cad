"""Logs on the page: the time line, events, charts, two logs over one another."""
import numpy as np
from pages import until, View
import pytest
from screen import Screen
from selenium.webdriver import ActionChains, Keys

import planar_chain_sim as pcs

pytestmark = pytest.mark.slow

STEP = 1e-3
TICKS = 3000
RESETS = (700, 1500, 2300)   # ticks


def make_log(path, effort):
    with pcs.OfflineLog(path, pcs.Simulation(pcs.load_chain('double_pendulum.yaml'))) as log:
        for tick in range(0, TICKS, 100):
            if tick in RESETS:
                log.change('reset')
            log.advance(100, effort=effort * np.sin([tick, tick + 1.0]))
    return path


@pytest.fixture(scope='module')
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp('logs')
    return make_log(folder / 'run.mcap', 3.0), make_log(folder / 'other.mcap', 5.0)


@pytest.fixture(scope='module')
def screen(browser, logs):
    """Return the page of the two logs, standing at its beginning."""
    with View(*logs, '--port', '0') as view:
        shown = Screen(browser, view.address)
        until(lambda: shown('return view.status && view.arms && view.timeline.marks.length > 0'))
        yield shown
        assert shown.errors() == []
        browser.get('about:blank')
        view.stop()


@pytest.fixture(autouse=True)
def at_rest(screen):
    screen('view.timeline.stop(); document.getElementById("loop").checked = false;'
           'document.getElementById("speed").value = 1; document.activeElement.blur(); view.timeline.seek(0)')


def press(screen, *keys):
    ActionChains(screen.browser).send_keys(*keys).perform()


def tick_is(screen, tick):
    until(lambda: screen('return view.arms[0].tick') == tick)


def test_scrubbing_shows_the_states_of_both_logs(screen, logs):
    runs = [pcs.load_log(path) for path in logs]
    slider = screen.browser.find_element('id', 'time')
    ticks = set()
    for share in (0.05, 0.31, 0.62, 0.97, 0.4):
        actions = ActionChains(screen.browser, duration=20)
        actions.move_to_element_with_offset(slider, round((share - 0.5) * slider.rect['width']), 0).click().perform()
        tick = int(screen('return view.timeline.time') / STEP + 1e-6)
        tick_is(screen, tick)
        assert abs(tick - share * TICKS) < 0.05 * TICKS
        for run, arm in zip(runs, screen('return view.arms.map(({position, velocity}) => [...position, ...velocity])')):
            assert arm == [*run.position[tick], *run.velocity[tick]]
        ticks.add(tick)
    assert len(ticks) == 5
    assert not np.array_equal(*(run.position[tick] for run in runs))


def test_single_ticks_and_events(screen):
    press(screen, Keys.ARROW_RIGHT, '.', Keys.ARROW_RIGHT)
    tick_is(screen, 3)
    press(screen, Keys.ARROW_LEFT)
    tick_is(screen, 2)
    for tick in RESETS:
        press(screen, 'n')
        tick_is(screen, tick)
    press(screen, 'n')   # there is no other one
    until(lambda: 'no other event' in screen('return document.getElementById("refused").textContent'))
    tick_is(screen, RESETS[-1])
    press(screen, 'p')
    tick_is(screen, RESETS[-2])
    assert screen('return document.querySelector("#event-list .now").textContent').startswith('1.500 sreset')
    items = screen.browser.find_elements('css selector', '#event-list li')
    oldest = next(item for item in reversed(items) if item.text.endswith('reset'))
    oldest.find_element('tag name', 'button').click()
    tick_is(screen, RESETS[0])
    press(screen, 'r')
    tick_is(screen, 0)


def test_play_pause_end_and_loop(screen):
    screen('document.getElementById("speed").value = 0.5')
    press(screen, ' ')
    until(lambda: screen('return view.arms[0].tick') > 20)
    press(screen, ' ')
    assert not screen('return view.timeline.playing')
    tick_is(screen, int(screen('return view.timeline.time') / STEP + 1e-6))
    screen('document.getElementById("speed").value = 50')
    press(screen, ' ')
    until(lambda: not screen('return view.timeline.playing'))
    tick_is(screen, TICKS)
    screen("""document.getElementById("loop").checked = true;
              window.seen = [];
              const turn = () => {
                seen.push(view.timeline.time);
                if (seen.length < 5000) requestAnimationFrame(turn);
              };
              turn();""")
    press(screen, ' ')
    until(lambda: screen('return seen.filter((time, k) => k && time < seen[k - 1]).length > 3'))
    assert screen('return view.timeline.playing')


def test_the_charts_have_the_rows_of_the_log(screen, logs):
    screen('view.timeline.seek(1.2)')
    rows = until(lambda: screen("""
        const table = view.charts.fixed?.[1];
        return table && view.arms[0].tick === 1200 &&
          [table.columns, [...table.time], [...table.low], [...table.high]];"""))
    run = pcs.load_log(logs[1])
    columns, time, low, high = rows
    low, high = (np.reshape(side, (len(time), columns)) for side in (low, high))
    assert columns == 9 and len(time) > 500 and (low <= high).all()
    energy = np.transpose(pcs.energy(run.chain, run.position, run.velocity))
    whole = np.concatenate([run.position, run.velocity, [*run.effort, run.effort[-1]], energy,
                            energy.sum(axis=1)[:, None]], axis=1)
    ticks = np.round(np.divide(time, STEP)).astype(int)
    for row, tick in enumerate(ticks[:-1].tolist()):
        within = whole[tick:ticks[row + 1], :4]
        assert (low[row, :4] <= within.min(axis=0)).all() and (high[row, :4] >= within.max(axis=0)).all()
    np.testing.assert_allclose(low[:, 6:], whole[ticks, 6:], rtol=1e-12, atol=1e-12)
    assert screen('return document.querySelectorAll("#strips figure").length') == 4   # no lateness of a log


def test_a_jump_brings_the_trail_that_led_there(screen, logs):
    """The trail of the end of the lower rod over 1 s, in both logs, without having played them."""
    screen('document.getElementById("trail-length").value = 1;'
           'document.getElementById("trail-length").dispatchEvent(new Event("change")); view.timeline.seek(1.4)')
    trails = until(lambda: screen("""
        const {trails, arms} = view.drawing;
        const whole = (trail) => trail.length > 200 && Math.abs(trail[0].time - 0.4) < 1e-6;
        return arms[0].tick === 1400 && trails.every(whole) &&
          trails.map((trail) => trail.map(({time, x, y}) => [time, x, y]));"""))
    length = screen('const {x1, y1, x2, y2} = view.arms[0].bodies[1].segments[0]; return Math.hypot(x2 - x1, y2 - y1)')
    for path, trail in zip(logs, trails):
        run, (time, *place) = pcs.load_log(path), np.transpose(trail)
        ticks = np.round(time / STEP).astype(int)
        assert ticks[0] == 400 and ticks[-1] == 1400
        poses = pcs.body_poses(run.chain, run.position[ticks])
        end = poses.point[:, 1] + length * np.transpose([np.cos(poses.angle[:, 1]), np.sin(poses.angle[:, 1])])
        np.testing.assert_allclose(np.transpose(place), end, rtol=0, atol=1e-9)
