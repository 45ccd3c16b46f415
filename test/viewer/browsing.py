# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page in a browser, as a test sees and touches it."""
import base64
from collections.abc import Callable
import io
from pathlib import Path
import time
from typing import Any

from nodes.live import PATIENCE, Process
import numpy as np
from PIL import Image
from scipy import ndimage

# Three bodies whose colours nothing else in the page has, side by side before the camera. The left
# one goes up to 0.4 m and down again on a spring, every 3.1 s for ever; the others rest.
SCENE = """
format: 1
world: {gravity: [0, 0, 0], step: 0.005, contact: none}
bodies:
  - name: left
    shape: {type: sphere, radius: 0.2}
    mass: 1.0
    color: [1, 0, 0]
    pose: {position: [-0.6, -0.6, 0]}
  - name: middle
    shape: {type: box, size: [0.4, 0.4, 0.4]}
    mass: 1.0
    color: [0, 0.8, 0]
  - name: right
    shape: {type: capsule, radius: 0.15, length: 0.2}
    mass: 1.0
    color: [1, 0, 1]
    pose: {position: [0.6, 0.6, 0]}
forces:
  - {type: spring, a: left, anchor: [-0.6, -0.6, 1.0], stiffness: 4, rest_length: 0.8}
"""
OTHER_SCENE = """
format: 1
world: {gravity: [0, 0, 0], step: 0.005, contact: none}
bodies:
  - name: only
    shape: {type: box, size: [0.4, 0.4, 0.4]}
    mass: 1.0
    color: [0, 0.8, 0]
"""
RED, GREEN, MAGENTA = 0, 120, 300
_SIZE = 700, 400    # px
# The processor draws: a picture of 1000 x 600 pixels takes 0.25 s of its time, one of 700 x 400
# with half as many pixels in a row 0.05 s. And each picture waits a little [ms] for the next one.
_COARSE = '/?fixedDpr=0.5'
_PAUSE = 350
_FEW_PICTURES = """
  const draw = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (callback) => setTimeout(() => draw(callback), PAUSE);
  window.cancelAnimationFrame = clearTimeout;
"""
# What the page hears of as of something typed: its framework overrides the setter of the element.
_REPLACE = """(element, text) => {
  const setter = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set;
  element.focus();
  setter.call(element, text);
  element.dispatchEvent(new Event('input', {bubbles: true}));
}"""
# What the page says in a corner is there for three seconds only: longer than a look may take.
_KEPT_NOTES = """
  window.saidInACorner = [];
  new MutationObserver((changes) => {
    for (const node of changes.flatMap((change) => [...change.addedNodes])) {
      const isNote = node instanceof Element && node.closest('.mantine-Notifications-root');
      if (isNote) window.saidInACorner.push(node.textContent);
    }
  }).observe(document, {childList: true, subtree: true});
"""
_CURSOR = "document.querySelector('canvas[data-engine]').style.cursor"
_PANEL = 360        # px at the right that the controls cover
_LEAST = 30         # px: smaller spots are edges, not bodies
_HUE = 30           # degrees to either side that are still this colour, in light and in shade
_LOOK = 200         # ms between two looks at a condition: each may need a picture
_SAME = 10          # pictures in a row in which what rests is in the same place
_STILL = 0.5        # px by which it may seem to move
_NARROW_HUE = 9     # the same where another colour is near
_DARK = 125         # of 255, in each of red, green and blue: letters of few pixels
_COLORLESS = 25     # of 255, between the strongest and the weakest of the three


def scene_file(folder: Path, text: str = SCENE) -> Path:
    """Write a scene to a file."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / 'scene.yaml'
    path.write_text(text, encoding='utf-8')
    return path


def view(folder: Path, *words: str) -> Process:
    """Start `rigid_sim view`; the browser draws less often than the page follows by default."""
    return Process(['rigid_sim', 'view', '--rate', '10', *words], folder, is_forked=True)


class Page:
    """One page in the browser."""

    def __init__(
        self, browser: Any, address: str, size: tuple[int, int] = _SIZE, *,
        pause: int = _PAUSE,
    ) -> None:
        """Open an address; `pause` [ms] is how long each picture waits for the next one."""
        # In a context of its own: nothing is shared with another page.
        self.page = browser.new_page(viewport=dict(zip(('width', 'height'), size, strict=True)))
        self.page.add_init_script(_FEW_PICTURES.replace('PAUSE', str(pause)))
        self.page.add_init_script(_KEPT_NOTES)
        self.page.set_default_timeout(1000 * PATIENCE)
        self.requests: list[str] = []
        self.home: tuple[float, float] | None = None    # px: the box, as the scene begins
        self.page.on('request', lambda request: self.requests.append(request.url))
        self._tools = self.page.context.new_cdp_session(self.page)
        self._open(address + _COARSE)

    def _open(self, address: str) -> None:
        def is_open() -> bool:
            try:
                self.page.goto(address)
            except Exception:       # refused until the program listens
                return False
            return True

        self.wait_for(is_open, f'{address} to answer')
        # A message about the missing graphics card would cover what is looked at.
        self.page.add_style_tag(content='.mantine-Notifications-root {visibility: hidden}')

    def close(self) -> None:
        self.page.close()

    def wait_for(self, condition: Callable[[], Any], what: str, look: int = _LOOK) -> Any:
        """
        Wait until the condition is true and return its value; the page lives on meanwhile.

        `look` [ms] is how long it does so between two looks.
        """
        end = time.monotonic() + PATIENCE
        while not (value := condition()):
            assert time.monotonic() < end, f'waited {PATIENCE} s for {what}'
            self.page.wait_for_timeout(look)
        return value

    def spots(self, hue: int) -> list[tuple[float, float]]:
        """Return the middles [px] of the spots of a colour, given in degrees."""
        return self._spots_in(self._picture(), hue)

    def _spots_in(self, picture: np.ndarray, hue: int) -> list[tuple[float, float]]:
        labels, _ = ndimage.label(_mask(picture, hue, _HUE))
        # Of the few pixels that have the colour alone: ndimage's sums go through the picture.
        y, x = np.nonzero(labels)
        spot = labels[y, x]
        sizes = np.bincount(spot)
        columns, rows = np.bincount(spot, x), np.bincount(spot, y)
        large = np.flatnonzero(sizes >= _LEAST)
        return list(zip(columns[large] / sizes[large], rows[large] / sizes[large], strict=True))

    def pixels(self, hue: int, within: float = _NARROW_HUE) -> int:
        """Return how many pixels have a colour, given in degrees."""
        return int(_mask(self._picture(), hue, within).sum())

    def _picture(self) -> np.ndarray:
        """Return the pixels of what is shown beside the controls, as hue, saturation and value."""
        return np.asarray(self._shown().convert('HSV'))

    def _shown(self) -> Image.Image:
        """
        Return what is shown beside the controls.

        The browser's own picture, packed quickly: `screenshot` of Playwright also changes the page
        before and after, and a look then takes more than twice the time of the processor.
        """
        answer = self._tools.send('Page.captureScreenshot',
                                  {'format': 'png', 'optimizeForSpeed': True})
        picture = Image.open(io.BytesIO(base64.b64decode(answer['data'])))
        return picture.crop((0, 0, picture.width - _PANEL, picture.height)).convert('RGB')

    def dark_pixels(self) -> int:
        """Return how many pixels are dark, as letters are."""
        return int((np.asarray(self._shown()).max(axis=2) < _DARK).sum())

    def grey_pixels(self, darkest: int, lightest: int) -> int:
        """Return how many pixels are about as light as that, of 255, and have no colour."""
        pixels = np.asarray(self._shown())
        light = pixels.max(axis=2)
        is_grey = light - pixels.min(axis=2) < _COLORLESS
        return int((is_grey & (light >= darkest) & (light <= lightest)).sum())

    def spot(self, hue: int) -> tuple[float, float]:
        """Wait for the only spot of a colour and return its middle."""
        def only() -> list[tuple[float, float]]:
            found = self.spots(hue)
            return found if len(found) == 1 else []

        middle: tuple[float, float] = self.wait_for(only, f'one spot of hue {hue}')[0]
        return middle

    def resting_spot(self, hue: int) -> tuple[float, float]:
        """Wait until the only spot of a colour stays where it is and return its middle."""
        x, y = self.settled(lambda: self.spot(hue), f'the spot of hue {hue} to stay where it is')
        return x, y

    def settled(self, measure: Callable[[], Any], what: str) -> Any:
        """Wait until numbers of a picture are the same in some in a row, and return them."""
        seen: list[Any] = []

        def is_settled() -> bool:
            seen.append(measure())
            last = np.array(seen[-_SAME:], dtype=float)
            return len(last) == _SAME and float(np.ptp(last, axis=0).max()) < _STILL

        self.wait_for(is_settled, what)
        return seen[-1]

    def counts(self) -> tuple[int, int, int]:
        """Return how many red, green and magenta bodies are in view, in one picture."""
        picture = self._picture()
        red, green, magenta = (len(self._spots_in(picture, hue)) for hue in (RED, GREEN, MAGENTA))
        return red, green, magenta

    def click(self, name: str) -> None:
        """Click on a button."""
        self.click_on(self.page.get_by_role('button', name=name, exact=True))

    def turn(self, name: str, into: str) -> None:
        """Click on a button that then has another name, and wait until it has."""
        self.click(name)
        turned = self.page.get_by_role('button', name=into, exact=True)
        self.wait_for(turned.count, f'the button {name} to become {into}')

    def tick(self, name: str) -> Any:
        """Click on a checkbox, and return it."""
        box = self.page.get_by_label(name, exact=True)
        self.click_on(box)
        return box

    def switch(self, name: str) -> None:
        """Click on a checkbox in the tab Show."""
        self.click_on(self.page.get_by_role('tab', name='Show'))
        self.tick(name)

    def fill(self, label: str, number: float, place: int = 0) -> None:
        """Type a number into a field, or that many fields behind the one with the label."""
        field = self.page.get_by_label(label, exact=True)
        if place:
            field = field.locator(f'xpath=following::input[{place}]')
        self.type_into(field, number)

    def fill_beside(self, slider: int, number: float) -> None:
        """Type a number beside a slider: the first, the second, ... that is in view."""
        self.type_into(self.page.locator('input[inputmode]:visible').nth(slider), number)

    def click_on(self, what: Any) -> None:
        """Click on anything in the page."""
        self.send()
        what.click()

    def type_into(self, field: Any, number: float) -> None:
        """Put a number in place of what a field holds."""
        self.send()
        self.replace_text(field, f'{number:g}')

    def replace_text(self, field: Any, text: str) -> None:
        """
        Put a text in place of what a field holds, in one step.

        `fill` of Playwright selects first and types then: what the page itself puts into the field
        in between is not selected, and stays.
        """
        field.evaluate(_REPLACE, text)

    def send(self) -> None:
        """Wait until the page has sent what was done in it."""
        # All inputs of viser's page share one timer: of what is done within 50 ms the first is
        # sent and the last, and nobody hears of those between. This timer ends after that one.
        self.page.evaluate('new Promise(done => setTimeout(done, 100))')

    def text(self) -> str:
        """Return all that is written in the page."""
        return str(self.page.inner_text('body'))

    def notes(self) -> str:
        """Return all that the page has ever said in its corner."""
        return '\n'.join(self.page.evaluate('window.saidInACorner'))

    def point_at(self, place: tuple[float, float]) -> None:
        """Move the mouse over a body and wait until the page takes it for one to be touched."""
        def is_over() -> bool:
            # The page looks for what is under the mouse when that moves.
            self.page.mouse.move(place[0] + 1.0, place[1])
            self.page.mouse.move(*place)
            return bool(self.page.evaluate(_CURSOR) == 'pointer')

        self.wait_for(is_over, f'a body at {place}')

    def touch(self, place: tuple[float, float]) -> None:
        """Click on a body."""
        self.point_at(place)
        self.page.mouse.click(*place)

    def hovered(self) -> str:
        """Return the name that stands beside the mouse, '' if none does."""
        return str(self.page.locator('#hovered-body').inner_text())

    def drag(
        self, start: tuple[float, float], end: tuple[float, float],
        until: Callable[[], Any] = lambda: True,
    ) -> None:
        """Move the mouse with its button down, and let go when a condition is true."""
        mouse = self.page.mouse
        self.point_at(start)
        mouse.down()
        for share in np.linspace(0.0, 1.0, 12):
            mouse.move(*(np.array(start) + share * (np.array(end) - start)))
            self.page.wait_for_timeout(60)
        self.wait_for(until, 'what the mouse drags to follow')
        mouse.up()


def _mask(picture: np.ndarray, hue: int, within: float) -> np.ndarray:
    """Return where pixels (hue, saturation, value, of 255) have a colour, given in degrees."""
    hues = np.arange(256) * 360 / 255
    within_hue = np.abs((hues - hue + 180) % 360 - 180) < within
    mask: np.ndarray = within_hue[picture[..., 0]]
    return mask & (picture[..., 1] > 100) & (picture[..., 2] > 40)
