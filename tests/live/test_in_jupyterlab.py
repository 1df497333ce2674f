"""A live view as a user has it: JupyterLab, a browser, a hand that orbits, controls, errors, a saved file."""

from __future__ import annotations

import base64
import io
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from selenium.webdriver import ActionChains, Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement

import miplight as ml
from miplight import demo
from miplight.notebook import auto_exposure, to_srgb8
from tests.live.conftest import Lab

SIZE = 384
MAKE = f"""
import miplight as ml
from miplight import demo
place = demo.spot_in_a_room(width={SIZE}, height={SIZE})
view = ml.live(place.scene, place.camera, supersample=1, adapter=ADAPTER)
view
"""


def _write(folder: Path, adapter: str) -> Path:
    cells = [MAKE.strip().replace("ADAPTER", repr(adapter)), "view.close()\nprint('closed', view)"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "this", "language": "python"}
    path = folder / "live.ipynb"
    nbformat.write(notebook, path)
    return path


def _data(name: str) -> str:
    return f'.miplight-live [data-name="{name}"]'


class Page:
    """What the test does with a page that shows the notebook."""

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


@pytest.fixture
def page(lab: Lab, browser: Chrome, adapter: str) -> Page:
    _write(lab.folder, adapter)
    opened = Page(browser, lab)
    opened.run(0)
    opened.until(lambda: opened.view["stage"] == "full size")
    return opened


def _difference(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    return float(np.abs(one.astype(np.float64) - other).mean())


@pytest.mark.slow
def test_a_view_in_jupyterlab(
    page: Page, lab: Lab, renderer: ml.Renderer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # it shows what a render gives, to the last bit
    place = demo.spot_in_a_room(width=SIZE, height=SIZE)
    frame = renderer.render(place.scene, place.camera)
    expected = to_srgb8(frame.image, auto_exposure(frame.image, frame.surface_mask))
    np.testing.assert_array_equal(page.pixels(), expected)

    # it follows a hand
    came, took = page.orbit(seconds=4.0)
    page.until(lambda: page.view["stage"] == "full size")
    page.screenshot("orbited")
    with capsys.disabled():
        print(f"\n{came} pictures in {took:.1f} s: {came / took:.1f} a second at {SIZE} × {SIZE}", end=" ")
    assert came / took >= 4.0
    assert _difference(page.pixels(), expected) > 5.0, "the camera has not moved"

    # controls, and an error that is shown where it is made
    before = page.pixels()
    page.choose("overlay", "levels")
    page.until(lambda: "level 0" in page.text(".legend"))
    assert _difference(page.pixels(), before) > 5.0
    page.screenshot("levels")
    page.choose("overlay", "off")
    page.choose("preset", "radiosity-2009")
    page.until(lambda: page.shown("indirect") == "clustered")
    page.choose("indirect", "final-gather")  # which this preset refuses
    page.until(lambda: "indirect_visibility" in page.text(".error"))
    page.js("document.querySelector('.miplight-live button:last-child').click()")  # reset
    page.until(lambda: _difference(page.pixels(), expected) == 0.0)
    assert page.text(".error") == ""

    # the file has a picture for where there are no widgets, and closing leaves one here
    page.command("docmanager:save")
    outputs = json.loads((lab.folder / "live.ipynb").read_text())["cells"][0]["outputs"]
    (shown,) = [output["data"] for output in outputs if output["output_type"] == "display_data"]
    stored = Image.open(io.BytesIO(base64.b64decode(shown["image/png"])))
    np.testing.assert_array_equal(np.asarray(stored), expected)
    page.run(1)
    page.until(lambda: page.browser.find_elements(By.CSS_SELECTOR, ".jp-OutputArea img"))
    assert not page.browser.find_elements(By.CSS_SELECTOR, ".miplight-live")

    # nothing went wrong on the way, and nothing came from anywhere else
    wrong = [entry for entry in page.console() if entry["level"] in ("SEVERE", "WARNING")]
    assert not wrong
    loaded = page.js("return performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert loaded
    assert not [url for url in loaded if not url.startswith((lab.url, "data:", "blob:"))]
