"""The files that animate writes for a browser, in a browser: they move as body_poses says, and the buttons work."""
import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain.visual import body_color
from planar_chain_sim.pictures.scene import Look, SAMPLE, Scene
from planar_chain_sim.pictures.vector import write_html, write_svg

COLOR = '#' + ''.join(f'{round(255 * part):02x}' for part in body_color(pcs.load_chain('double_pendulum.yaml'), 1)[:3])
ENDS = f"""const path = document.querySelector('path[stroke="{COLOR}"]:not([opacity])');
return [0, path.getTotalLength()].map(at => path.getPointAtLength(at)).flatMap(point => [point.x, point.y])"""


@pytest.fixture(scope='module')
def turning():
    """Return the scene of a double pendulum that turns, and the ends of its second rod, px, (rows, 2)."""
    chain = pcs.load_chain('double_pendulum.yaml')
    angles = np.linspace(0.0, 2.0, round(4.0 / SAMPLE) + 1)
    position = np.stack([angles, 0.0 * angles], axis=1)
    scene, poses = Scene(chain, position, Look(traced=[(1, None)])), pcs.body_poses(chain, position)
    start = poses.point[:, 1] @ [1.0, 1.0j]
    return scene, scene.px(np.stack([start, 2.0 * (poses.center_of_mass[:, 1] @ [1.0, 1.0j]) - start], axis=1))


def ends(browser):
    numbers = browser.execute_script(ENDS)
    return np.array([complex(*numbers[:2]), complex(*numbers[2:])])


@pytest.mark.parametrize('write, kind', [(write_svg, 'svg'), (write_html, 'html')])
def test_the_browser_draws_what_body_poses_says(write, kind, turning, browser, tmp_path):
    """At times between two frames too; the text says the time; nothing is wrong with the file."""
    scene, wanted = turning
    path = tmp_path / f'arm.{kind}'
    with open(path, 'wb') as stream:
        write(scene, stream, lambda count: None)
    browser.get(path.as_uri())
    for time in (0.0, 1.0, 2.5, 2.52, 3.9):
        if kind == 'svg':
            browser.execute_script(f"const svg = document.querySelector('svg'); svg.pauseAnimations(); "
                                   f'svg.setCurrentTime({time})')
        else:
            browser.execute_async_script(
                f"const [at, done] = [document.querySelector('#at'), arguments[0]]; at.value = {time}; "
                "at.dispatchEvent(new Event('input')); requestAnimationFrame(() => requestAnimationFrame(done))")
        np.testing.assert_allclose(ends(browser), wanted[round(time / SAMPLE)], atol=0.1)
        shown = browser.execute_script("return [...document.querySelectorAll('text')].filter(each => "
                                       "getComputedStyle(each).visibility == 'visible').map(each => each.textContent)")
        assert shown[-1] == f't = {np.floor(time / 0.04 + 1e-6) * 0.04:.2f} s' and len(shown) == 2
    assert not browser.get_log('browser')


def test_the_buttons_of_a_page(turning, browser, tmp_path):
    """It runs by itself; a key stops it, others go frame by frame and to the end."""
    scene, wanted = turning
    with open(tmp_path / 'arm.html', 'wb') as stream:
        write_html(scene, stream, lambda count: None)
    browser.get((tmp_path / 'arm.html').as_uri())
    browser.execute_async_script("""const [done, begin] = [arguments[0], time];
      (function wait() { time != begin ? done() : requestAnimationFrame(wait) })()""")   # it runs
    button, page = (browser.find_element('css selector', name) for name in ('#run', 'body'))
    assert button.text == 'Pause'
    button.click()
    browser.execute_async_script('requestAnimationFrame(() => requestAnimationFrame(arguments[0]))')
    assert button.text == 'Play'
    for key, row in (('\ue010', -1), ('\ue012', -5), ('\ue011', 0), ('\ue014', 4)):   # End, left, Home, right
        page.send_keys(key)
        browser.execute_async_script('requestAnimationFrame(() => requestAnimationFrame(arguments[0]))')
        np.testing.assert_allclose(ends(browser), wanted[row], atol=0.1)
    assert not browser.get_log('browser')
