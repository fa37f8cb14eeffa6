"""The report of a decoded folder in a browser, opened from the disk."""

import numpy as np
import pytest

from fpputil.capture.folder import decode_folder
from fpputil.capture.patterns import Patterns
from fpputil.capture.virtual import photograph_into
from fpputil.optics.fringes import fringe_set

PATTERNS = Patterns((912, 1140), fringe_set((912, 114, 24), 4))


@pytest.fixture(scope="module")
def decoded(tmp_path_factory, sphere_view, tiny):
    folder = tmp_path_factory.mktemp("report") / "shots <b>"
    photograph_into(folder, sphere_view, PATTERNS, tiny.system, noise=1.0)
    return decode_folder(folder, system=tiny.system, pictures=False)


def test_a_pixel_that_is_pointed_at_is_marked_in_all_panels(browser, decoded):
    page = browser.new_page(viewport={"width": 1200, "height": 1000})
    faults = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
    page.on("request", lambda r: faults.append(r.url) if r.url.startswith("http") else None)
    page.goto((decoded.out / "report.html").as_uri())
    page.wait_for_selector(".fpp-live[data-on=yes]")
    m = decoded.measurements[0]
    maps = page.locator(".fpp-map")
    charts = page.locator(".fpp-plot")
    assert maps.count() == 7 and charts.count() == 3 + 3  # of each pitch the samples
    assert page.locator("figure img").first.is_hidden()  # the still picture gives way
    for v, u in ((60, 80), (5, 5)):
        box = maps.nth(3).bounding_box()
        x, y = ((u + 0.5) / 160 * box["width"], (v + 0.5) / 120 * box["height"])
        page.mouse.move(box["x"] + x, box["y"] + y)
        crosses = page.locator(".fpp-cross").evaluate_all("all => all.map(c => c.style.left)")
        assert len(set(crosses)) == 1 and len(crosses) == 7

        def told(name):
            return page.locator(f'.fpp-numbers [data-number="{name}"]').first.inner_text()

        assert f"v {v}, u {u}" in told("pixel")
        assert m.mask[v, u] == (v == 60)
        assert ("good" if m.mask[v, u] else "dark") in told("why left out")
        assert ("no value" in told("uncertainty")) == bool(np.isnan(m.sigma[v, u]))
        assert "along row" in page.locator(".fpp-plot").nth(2).text_content()
    assert faults == []
    page.close()


def test_samples_of_a_response_lie_on_its_curve(browser, tmp_path, sphere_view, tiny):
    patterns = Patterns((912, 1140), fringe_set((912, 114, 24), 8), white="w.png", black="b.png")
    camera = {"noise": 0.5, "response": 2.2, "ambient": 10}
    photograph_into(tmp_path / "shots", sphere_view, patterns, tiny.system, **camera)
    how = {"gamma": 2.2, "report": True, "pictures": False, "system": tiny.system}
    decoded = decode_folder(tmp_path / "shots", **how)
    page = browser.new_page()
    page.goto((decoded.out / "report.html").as_uri())
    page.wait_for_selector(".fpp-live[data-on=yes]")
    numbers = page.evaluate(
        "document.querySelector('.fpp-live').compute({frame: 0, v: 60, u: 80}).numbers"
    )
    off = [value for name, (value, *_) in numbers.items() if name.endswith("off its curve")]
    frames = decoded.measurements[0].shown
    assert len(off) == 3 and max(off) < 4  # grey levels, of a noise of half a one
    sinusoid = [one[:, 60, 80].astype(float) for one in frames]
    for grey in sinusoid:
        spectrum = np.fft.fft(grey)
        spectrum[2:-1] = 0
        assert np.abs(grey - np.fft.ifft(spectrum).real).max() > 8
    page.close()
