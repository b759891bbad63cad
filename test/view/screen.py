"""The page in a browser: what is drawn, and the mouse on it."""
from base64 import b64decode
from io import BytesIO

import numpy as np
from pages import until
from PIL import Image
from selenium.webdriver import ActionChains

REACH = 12.0   # px to either side of a body that are looked at


class Screen:
    """The page at an address, in a tab of a browser."""

    def __init__(self, browser, address):
        self.browser = browser
        browser.get(address)
        until(lambda: self('return window.view && view.frames > 0'))

    def __call__(self, script, *arguments):
        """Run JavaScript in the page and return what it returns."""
        return self.browser.execute_script(script, *arguments)

    def errors(self):
        """Return what the page has written to the console."""
        return self.browser.get_log('browser')

    def click(self, name):
        """Click a button of this id as soon as it can be pressed."""
        button = self.browser.find_element('id', name)
        until(button.is_enabled)
        button.click()

    def arm(self):
        """Return the first arm as it is drawn."""
        return self('return view.arms[0]')

    def pixel(self, point):
        """Return where a point of the plane is on the canvas, by the camera's numbers alone."""
        width, height, x, y, scale = self('const c = view.camera; return [c.width, c.height, c.x, c.y, c.scale]')
        return width / 2 + (point[0] - x) * scale, height / 2 - (point[1] - y) * scale

    def picture(self):
        """Return the canvas as (height, width, 4) bytes, and its pixels per pixel of the page."""
        address, width = self('const c = document.getElementById("arm"); return [c.toDataURL(), c.clientWidth]')
        pixels = np.array(Image.open(BytesIO(b64decode(address.partition(',')[2]))).convert('RGBA'))
        return pixels, pixels.shape[1] / width

    def press(self, pixel, move=(0, 0)):
        """Press the mouse at a pixel of the canvas, and move it while it is held."""
        canvas = self.browser.find_element('id', 'arm')
        actions = ActionChains(self.browser, duration=20)
        actions.move_to_element_with_offset(canvas, round(pixel[0] - canvas.rect['width'] / 2),
                                            round(pixel[1] - canvas.rect['height'] / 2))
        actions.click_and_hold().move_by_offset(*map(round, move)).perform()

    def let_go(self):
        ActionChains(self.browser).release().perform()

    def slide(self, element, share):
        """Press the thumb of a slider that stands in its middle and move it by a share of its length."""
        actions = ActionChains(self.browser, duration=20)
        actions.click_and_hold(element).move_by_offset(round(share * element.rect['width']), 0).perform()


def across(picture, start, end, share, color):
    """
    Return where a body is drawn, px beside the line from start to end, pixels, seen across it at a share of it.

    That is the middle of the pixels that have its colour, '#rrggbb'; None if there are none.
    """
    pixels, ratio = picture
    along = np.subtract(end, start)
    side = np.array([-along[1], along[0]]) / np.hypot(*along)
    away = np.arange(-REACH, REACH, 0.25)
    places = np.floor((start + share * along + away[:, None] * side) * ratio).astype(int)
    wanted = [int(color[k:k + 2], 16) for k in (1, 3, 5)]
    found = away[np.abs(pixels[places[:, 1], places[:, 0], :3] - np.array(wanted)).max(axis=1) <= 2]
    return float(found[[0, -1]].mean()) if len(found) else None
