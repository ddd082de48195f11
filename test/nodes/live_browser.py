# SPDX-License-Identifier: BSD-3-Clause
"""A page of the live view in a headless Chromium, and what can be read from it."""
import contextlib
import io

import numpy as np
from PIL import Image
from selenium import webdriver
from selenium.common import exceptions
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service

from sim_probe import wait_until

#: Software rendering, as there is no GPU; without a sandbox, as tests may run as root.
_FLAGS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
          "--disable-dev-shm-usage", "--no-first-run", "--force-device-scale-factor=0.5")
_SCALE = 2                  # pixels of the page, along each side, for a pixel that is drawn: a quarter of the work
#: Lists of the panel: their options, as far as tests choose them.
_LISTS = (("free", "follow the robot", "from above"), ("0.75", "1", "2"), ("as it is", "empty", "shapes"),
          ("select and drag", "send a goal", "place a box", "place a cylinder",
           "place the model barrel"))
_LIST = 10.0                # s after which a list that does not open is opened again
_START = 60.0               # s of wall time in which a page is drawn by software


class Page:
    """A browser with one page; a context manager that closes it."""

    def __init__(self, address, size=(900, 700)):
        options = Options()
        for flag in _FLAGS + ("--window-size=%d,%d" % size,):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
        self.driver.set_page_load_timeout(_START)
        self.driver.set_script_timeout(_START)
        self.address = address

    def __enter__(self):
        try:
            self.open()
        except BaseException:
            self.driver.quit()
            raise
        return self

    def __exit__(self, *_):
        self.driver.quit()

    def open(self):
        """Load the page and wait until it shows the scene and the status."""
        self.driver.get(self.address)
        wait_until(lambda: "time" in self.status(), "the status on the page", _START)
        wait_until(lambda: len(np.unique(self.scene().astype(np.uint32) @ (1, 256, 65536))) > 50, "a scene on the page",
                   _START)

    @contextlib.contextmanager
    def elsewhere(self, address):
        """Show another live view in a second tab, which this page is meanwhile."""
        first = self.driver.current_window_handle
        self.driver.switch_to.new_window("tab")
        try:
            self.driver.get(address)
            wait_until(lambda: "time" in self.status(), "the status on the page", _START)
            yield
        finally:
            self.driver.close()
            self.driver.switch_to.window(first)

    def status(self):
        """Return the text of the status."""
        return self.driver.execute_script(
            "const found = document.getElementById('m2wr-status'); return found ? found.textContent : ''")

    def text(self):
        """Return all text of the page, also what is folded."""
        return self.driver.execute_script("return document.body.textContent")

    def panel_height(self):
        """Return how much of the content of the panel is shown [pixels]; 0: the panel is closed."""
        return float(self.driver.execute_script(
            "let found = [...document.querySelectorAll('#root button')].find((one) => one.textContent === 'pause');"
            "let least = found ? Infinity : 0;"
            "for (; found && found.id !== 'root'; found = found.parentElement)"
            " { least = Math.min(least, found.getBoundingClientRect().height); }"
            "return least"))

    def resize(self, width, height):
        """Give the page another size [pixels] than that of its window, until ``resize_to_window``."""
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
            "width": width, "height": height, "deviceScaleFactor": 0, "mobile": False})

    def resize_to_window(self):
        """Give the page the size of its window."""
        self.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})

    def covers_panel(self):
        """Return whether the longest status possible lies over the panel."""
        return self.driver.execute_script(
            "const status = document.getElementById('m2wr-status'), text = status.textContent;"
            "let panel = [...document.querySelectorAll('#root button')].find((one) => one.textContent === 'pause');"
            "while (panel && getComputedStyle(panel).zIndex === 'auto') { panel = panel.parentElement; }"
            "status.textContent = 'word '.repeat(40);"
            "const right = status.getBoundingClientRect().right;"
            "status.textContent = text; return right > panel.getBoundingClientRect().left")

    def joystick(self):
        """Return whether the joystick is shown."""
        return self.driver.execute_script("return getComputedStyle(document.getElementById('m2wr-drive')).display") \
            != "none"

    def value(self, name):
        """Return the value behind a name of the status, or None."""
        for line in self.status().splitlines():
            if line.startswith(name + "  "):
                return line[len(name):].strip()
        return None

    def scene(self):
        """Return the pixels (rows, columns, 3) of the left part of the page, without panel, joystick and status."""
        with Image.open(io.BytesIO(wait_until(self._screenshot, "a screenshot", _START))) as picture:
            pixels = np.asarray(picture.convert("RGB")).repeat(_SCALE, axis=0).repeat(_SCALE, axis=1)
        rows, columns = pixels.shape[:2]
        return pixels[:int(0.7 * rows), :int(0.6 * columns)]

    def _screenshot(self):
        """Return the page as PNG, or None: chromedriver gives up after 10 s, which a busy machine may need."""
        try:
            return self.driver.get_screenshot_as_png()
        except exceptions.TimeoutException:
            return None

    def press(self, key, down):
        """Press or release a key of the keyboard, by its name in JavaScript."""
        self.driver.execute_cdp_cmd("Input.dispatchKeyEvent", {
            "type": "keyDown" if down else "keyUp", "key": key, "code": key})

    def click(self, x, y):
        """Click at a place of the page [pixels]."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", {
                "type": kind, "x": x, "y": y, "button": "none" if kind == "mouseMoved" else "left", "clickCount": 1})

    def drag(self, begin, end, release=True):
        """Move the mouse with its button pressed from one place of the page to another [pixels], in ten steps."""
        def event(kind, place, button):
            self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", {
                "type": kind, "x": place[0], "y": place[1], "button": button, "clickCount": 1,
                "buttons": int(button == "left" and kind != "mouseReleased")})

        event("mouseMoved", begin, "none")
        event("mousePressed", begin, "left")
        for part in range(1, 11):
            event("mouseMoved", [a + 0.1 * part * (b - a) for a, b in zip(begin, end)], "left")
        if release:
            event("mouseReleased", end, "left")

    def elements(self, kind, content, attribute="textContent"):
        """Return the visible elements of a CSS selector whose text, or value, is ``content``; read at once."""
        return self.driver.execute_script(
            "return Array.from(document.querySelectorAll(arguments[0])).filter((element) => "
            "element.offsetParent !== null && element[arguments[2]].trim() === arguments[1])", kind, content, attribute)

    def press_button(self, text):
        """Click on the button with a text."""
        self._click_on("button", text)

    def choose(self, option):
        """Choose an option of the list that has it."""
        options = next(options for options in _LISTS if option in options)
        if self.elements("input", option, "value"):
            return
        for patience in (_LIST, _LIST, _START):
            present, = wait_until(lambda: [other for other in options if self.elements("input", other, "value")],
                                  "the list with " + option, _START)
            self._click_on("input", present, "value")
            with contextlib.suppress(AssertionError if patience == _LIST else ()):  # the page may have closed the list
                self._click_on("[role=option]", option, patience=patience)
                break
        wait_until(lambda: self.elements("input", option, "value"), "the choice of " + option, _START)

    def unfold(self, title):
        """Open a folder of the panel that is folded."""
        def click():
            found = self.driver.execute_script(
                "const labels = Array.from(document.querySelectorAll('div, legend')).filter((element) => "
                "element.children.length <= 1 && element.textContent.trim() === arguments[0]);"
                "if (labels.length) { labels[labels.length - 1].click(); } return labels.length", title)
            return found
        wait_until(click, "the folder " + title, _START)

    def save(self, name):
        """Press the link with which the page offers a file."""
        self._click_on("a", name, "download")

    def _click_on(self, kind, content, attribute="textContent", patience=_START):
        """Click on an element as soon as it is there; the page may replace it meanwhile."""
        def click():
            try:
                found = self.elements(kind, content, attribute)
                if found:
                    found[0].click()
                return found
            except (exceptions.StaleElementReferenceException, exceptions.ElementNotInteractableException):
                return None
        wait_until(click, "%s with %s" % (kind, content), patience)

    def errors(self):
        """Return the errors in the console of the browser."""
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]
