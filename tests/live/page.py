"""What a test does with a page of JupyterLab that shows a notebook with a live view."""

from __future__ import annotations

import base64
import io
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from selenium.webdriver import ActionChains, Chrome
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement

from tests.live.conftest import Lab


def _data(name: str) -> str:
    return f'.miplight-live [data-name="{name}"]'


class Page:
    """A page that shows `live.ipynb`, whose first cell shows a live view."""

    def __init__(self, browser: Chrome, lab: Lab) -> None:
        self.browser, self.pictures = browser, lab.folder.parent
        browser.get(f"{lab.url}/lab/tree/live.ipynb")
        self.until(lambda: self.js("return !!window.jupyterapp?.shell.currentWidget?.content?.widgets"))
        self.until(lambda: self.js("return !!jupyterapp.shell.currentWidget.sessionContext.session?.kernel"))

    def js(self, script: str, *arguments: Any) -> Any:
        """What a function with this body returns in the page."""
        return self.browser.execute_script(script, *arguments)

    def command(self, name: str) -> None:
        """Run a command of JupyterLab and wait until it is done."""
        script = (
            "const done = arguments[1]; jupyterapp.commands.execute(arguments[0]).then(() => done(), done);"
        )
        failed = self.browser.execute_async_script(script, name)
        assert not failed, failed

    def reset(self) -> None:
        """Press the button of this name."""
        self.js("[...document.querySelectorAll('.miplight-live button')].at(-1).click()")

    def run(self, cell: int) -> None:
        """Run a cell of the notebook."""
        self.js("jupyterapp.shell.currentWidget.content.activeCellIndex = arguments[0]", cell)
        self.command("notebook:run-cell")

    def text(self, selector: str) -> str:
        """What a part of the view says, as far as it is seen."""
        return self.browser.find_element(By.CSS_SELECTOR, f".miplight-live {selector}").text

    def shown(self, name: str) -> str:
        """What a control of choices says."""
        return str(
            self.js("return document.querySelector(arguments[0]).selectedOptions[0]?.text", _data(name))
        )

    def until(self, there: Callable[[], Any], seconds: float = 60) -> Any:
        """Wait until something is there."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = there()
            if found:
                return found
            time.sleep(0.05)
        self.screenshot("failed")
        raise AssertionError(f"not there after {seconds} s; console: {self.console()}")

    def ask(self, expected: str) -> None:
        """Run the cell that prints what the kernel has, until it is what is expected."""

        def said() -> bool:
            self.run(1)
            script = "return jupyterapp.shell.currentWidget.content.widgets[1].outputArea.node.innerText"
            return expected in self.js(script)

        self.until(said, seconds=10)

    def screenshot(self, name: str) -> None:
        """Store what the window shows, beside the notebook's folder."""
        self.browser.save_screenshot(str(self.pictures / f"{name}.png"))

    def console(self) -> list[dict[str, Any]]:
        """What the browser's console said since it was last asked."""
        return [dict(entry) for entry in self.browser.get_log("browser")]  # type: ignore[no-untyped-call]

    @property
    def view(self) -> dict[str, str]:
        """Data of the view: pictures shown so far, the stage of the last one, errors."""
        found = self.js("return {...document.querySelector('.miplight-live')?.dataset}")
        return {"frames": "0", "stage": "", "errors": "0", **found}

    @property
    def canvas(self) -> WebElement:
        """The picture."""
        return self.browser.find_element(By.CSS_SELECTOR, ".miplight-live canvas")

    def pixels(self) -> NDArray[np.uint8]:
        """What the canvas shows."""
        url = self.js("return document.querySelector('.miplight-live canvas').toDataURL('image/png')")
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(url.split(",")[1]))).convert("RGB"))

    def choose(self, name: str, label: str) -> None:
        """Choose from a control by what it says."""
        script = """
            const input = document.querySelector(arguments[0]);
            input.value = [...input.options].findIndex((option) => option.text === arguments[1]);
            input.dispatchEvent(new Event("input"));
        """
        self.js(script, _data(name), label)

    def orbit(self, seconds: float) -> tuple[int, float]:
        """Drag in circles; pictures that came meanwhile, and seconds that it took."""
        hand = ActionChains(self.browser, duration=0)
        hand.move_to_element(self.canvas).click_and_hold().perform()
        start, frames, moves = time.monotonic(), int(self.view["frames"]), 0
        while time.monotonic() - start < seconds:
            step = [round(4 * wave(0.2 * moves)) for wave in (math.cos, math.sin)]
            ActionChains(self.browser, duration=0).move_by_offset(*step).perform()
            moves += 1
        took, came = time.monotonic() - start, int(self.view["frames"]) - frames
        assert moves > 10 * seconds, "the test's own hand is too slow to be followed"
        hand.release().perform()
        return came, took

    def drag(self, right: int, down: int, key: str) -> None:
        """Drag from the middle of the picture, with a key held."""
        hand = ActionChains(self.browser, duration=20).move_to_element(self.canvas)
        hand.key_down(key).click_and_hold().move_by_offset(right, down).release().key_up(key).perform()

    def wheel(self, pixels: int) -> None:
        """Turn the wheel over the picture."""
        origin = ScrollOrigin.from_element(self.canvas)
        ActionChains(self.browser).scroll_from_origin(origin, 0, pixels).perform()
