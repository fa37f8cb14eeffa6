"""`fpp patterns`: the page that shows them in a browser, pixel for pixel; and `fpp --version`."""

import re
import subprocess
import sys
from importlib.metadata import version

import cv2
import numpy as np
import pytest

from fpputil.cli import main

WIDTH, HEIGHT = 320, 200


@pytest.fixture(scope="module")
def patterns(tmp_path_factory):
    out = tmp_path_factory.mktemp("Grüße") / "a <b> & 'c'"
    size = ["--projector", f"{WIDTH}x{HEIGHT}", "--pitches", "320", "33", "7.3", "--steps", "3"]
    assert main(["patterns", str(out), *size]) == 0
    return out


@pytest.fixture
def opened(browser, patterns):
    """Open the page from the disk in a window of some pixels and zoom."""
    contexts, faults = [], []

    def open_page(width=WIDTH, height=HEIGHT, scale=1):
        size = {"width": round(width / scale), "height": round(height / scale)}
        contexts.append(browser.new_context(viewport=size, device_scale_factor=scale, offline=True))
        page = contexts[-1].new_page()
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda r: faults.extend([r.url] * (not r.url.startswith("file:"))))
        page.goto((patterns / "show.html").as_uri(), wait_until="load")
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert faults == []


def on_screen(page):
    data = np.frombuffer(page.screenshot(), np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)


def pictures(folder):
    return [cv2.imread(str(p), cv2.IMREAD_GRAYSCALE) for p in sorted(folder.glob("*.png"))]


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1, 1.25, 2])
def test_each_pattern_is_on_the_screen_pixel_for_pixel(opened, patterns, scale):
    page, shown = opened(scale=scale), []
    for picture in pictures(patterns):
        page.keyboard.press("ArrowRight")
        shown.append(on_screen(page))
        np.testing.assert_array_equal(shown[-1], picture)
    assert len(shown) == 11
    page.keyboard.press("PageUp")
    np.testing.assert_array_equal(on_screen(page), shown[-2])
    page.keyboard.press(" ")
    page.mouse.click(50, 50)  # after the last the first page comes back
    assert "All 11 were shown" in page.inner_text("#start")


@pytest.mark.slow
def test_another_size_or_zoom_is_warned_of_before_the_first_pattern(opened):
    assert "Size and zoom are right" in opened().inner_text("#fit")
    page = opened(640, 480)
    said = page.inner_text("#fit")
    assert "Warning: this window has 640 x 480 pixels, the patterns 320 x 200" in said
    page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
    page.wait_for_function("document.querySelector('#fit').className === 'right'")
    assert "the zoom of browser and system is 125 %" in opened(scale=1.25).inner_text("#fit")


@pytest.mark.slow
def test_the_whole_screen_a_number_and_a_clock_on_request(opened, patterns):
    page, pictured = opened(), pictures(patterns)
    page.keyboard.press("f")
    page.wait_for_function("document.fullscreenElement !== null")
    page.keyboard.press("n")
    page.keyboard.press("ArrowRight")
    assert page.inner_text("#corner") == "1 of 11: 000-white.png"
    shown = on_screen(page)
    assert (shown[:150] == pictured[0][:150]).all() and (shown[-30:, -100:] < 255).any()
    page.keyboard.press("n")
    np.testing.assert_array_equal(on_screen(page), pictured[0])
    page.keyboard.press("Home")
    page.fill("#seconds", "0.05")
    page.locator("#seconds").blur()
    page.keyboard.press("c")
    page.wait_for_function("document.querySelector('#end').textContent.startsWith('All 11')")


def test_a_picture_that_is_missing_is_named_and_names_are_escaped(patterns):
    page = (patterns / "show.html").read_text(encoding="utf-8")
    names = re.search(r"const files = (\[.*?\])", page)[1]
    assert names.count(".png") == 11 and "is not beside this page" in page
    from fpputil.cli.patterns import show_page

    hostile = show_page(["</script><b>.png"], (3, 2))
    assert "</script><b>" not in hostile and "1 patterns of 3 x 2 pixels" in hostile


def test_the_version_is_that_of_the_package(fpp):
    assert fpp("--version") == (0, f"fpp {version('fpputil')}\n", "")


@pytest.mark.slow
def test_the_package_runs_as_the_command():
    command = [sys.executable, "-m", "fpputil", "--version"]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    assert run.stdout == f"fpp {version('fpputil')}\n"
