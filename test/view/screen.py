"""The page in a browser: what is drawn, and the mouse on it."""
from pages import until
from selenium.webdriver import ActionChains

STEPS = 25   # px to either side of a body that are looked at
COLUMN = """
const canvas = document.getElementById('arm'), pen = canvas.getContext('2d'), ratio = canvas.width / canvas.clientWidth;
return arguments[0].map(([x, y]) => Array.from(pen.getImageData(Math.round(x * ratio), Math.round(y * ratio), 1, 1).data));
"""


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
        self.browser.find_element('id', name).click()

    def arm(self):
        """Return the first arm as it is drawn."""
        return self('return view.arms[0]')

    def pixel(self, point):
        """Return where a point of the plane is on the canvas, by the camera's numbers alone."""
        width, height, x, y, scale = self('const c = view.camera; return [c.width, c.height, c.x, c.y, c.scale]')
        return width / 2 + (point[0] - x) * scale, height / 2 - (point[1] - y) * scale

    def colors(self, pixels):
        """Return red, green, blue and opacity of pixels of the canvas."""
        return self(COLUMN, [list(map(float, pixel)) for pixel in pixels])

    def across(self, start, end, share, color):
        """
        Return where a body is drawn, px beside the line from start to end, pixels, seen across it at a share of it.

        That is the middle of the pixels that have its colour, '#rrggbb'; None if there are none.
        """
        (ax, ay), (bx, by) = start, end
        length = ((bx - ax)**2 + (by - ay)**2)**0.5
        sides = [0.5 * step for step in range(-2 * STEPS, 2 * STEPS + 1)]
        seen = self.colors([(ax + share * (bx - ax) - side * (by - ay) / length,
                             ay + share * (by - ay) + side * (bx - ax) / length) for side in sides])
        wanted = [int(color[k:k + 2], 16) for k in (1, 3, 5)]
        found = [side for side, rgba in zip(sides, seen) if max(abs(a - b) for a, b in zip(rgba, wanted)) <= 2]
        return (min(found) + max(found)) / 2 if found else None

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
