"""A live view as a user has it: JupyterLab, a browser, a hand that orbits, controls, errors, a saved file."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path

import nbformat
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

import miplight as ml
from miplight import demo
from miplight.notebook import auto_exposure, to_srgb8
from tests.live.conftest import Lab
from tests.live.page import Page

SIZE = 384
MAKE = f"""
import miplight as ml
from miplight import demo
place = demo.spot_in_a_room(width={SIZE}, height={SIZE})
view = ml.live(place.scene, place.camera, supersample=1, adapter=ADAPTER)
view
"""


SAY = """
import threading
threads = sum(thread.name == "miplight-live" for thread in threading.enumerate())
camera = "still" if view.camera == place.camera else "moved"
corners = [scene.lights["light_0"].corner.tolist() for scene in (view.scene, place.scene)]
light = "still" if corners[0] == corners[1] else "moved"
print(f"camera {camera}, light {light}, {threads} threads")
"""


def _write(folder: Path, adapter: str) -> Path:
    cells = [MAKE.strip().replace("ADAPTER", repr(adapter)), SAY.strip(), "view.close()"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "this", "language": "python"}
    path = folder / "live.ipynb"
    nbformat.write(notebook, path)
    return path


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

    # with Alt it moves the light, and with the wheel the camera
    page.reset()
    page.until(lambda: _difference(page.pixels(), expected) == 0.0)
    page.ask("camera still, light still, 1 threads")
    page.drag(30, 20, Keys.ALT)
    page.ask("camera still, light moved, 1 threads")
    page.wheel(100)
    page.ask("camera moved, light moved, 1 threads")
    page.until(lambda: page.view["stage"] == "full size")

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
    page.reset()
    page.until(lambda: _difference(page.pixels(), expected) == 0.0)
    assert page.text(".error") == ""

    # a view whose output is made anew frees what it had
    page.run(0)
    page.until(lambda: page.view["stage"] == "full size")
    page.ask("camera still, light still, 1 threads")

    _leaves_a_picture(page, lab, expected)
    _nothing_went_wrong(page, lab)


def _nothing_went_wrong(page: Page, lab: Lab) -> None:
    """No word on the console, and nothing that came from anywhere else."""
    wrong = [entry for entry in page.console() if entry["level"] in ("SEVERE", "WARNING")]
    assert not wrong
    loaded = page.js("return performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert loaded
    assert not [url for url in loaded if not url.startswith((lab.url, "data:", "blob:"))]


def _leaves_a_picture(page: Page, lab: Lab, expected: NDArray[np.uint8]) -> None:
    """The file has one for where there are no widgets, and closing leaves one in the view's place."""
    page.command("docmanager:save")
    outputs = json.loads((lab.folder / "live.ipynb").read_text())["cells"][0]["outputs"]
    (shown,) = [output["data"] for output in outputs if output["output_type"] == "display_data"]
    stored = Image.open(io.BytesIO(base64.b64decode(shown["image/png"])))
    np.testing.assert_array_equal(np.asarray(stored), expected)
    page.run(2)
    page.until(lambda: page.browser.find_elements(By.CSS_SELECTOR, ".jp-OutputArea img"))
    assert not page.browser.find_elements(By.CSS_SELECTOR, ".miplight-live")
