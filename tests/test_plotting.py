"""Figures: maps leave the mask blank; both ways of drawing bodies see the same scene."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from fpputil import plotting
from fpputil.optics.shapes import sphere
from fpputil.probe import pyvista_works

SCENE = [(sphere(100, (0, 0, 680), 4), "lightsteelblue"), (sphere(30, (150, 0, 600), 3), "crimson")]
VIEW = (np.array([-400.0, -300, 0]), np.array([0.0, 0, 650]), (320, 240), 30.0)


@pytest.mark.parametrize(
    "draw", [plotting.wrapped, plotting.absolute, plotting.depth, plotting.error, plotting.orders]
)
def test_maps_leave_nan_blank(draw):
    values = np.linspace(-1, 1, 100).reshape(10, 10)
    values[:5] = np.nan
    fig, axes = plotting.panels(1)
    draw(axes[0], values)
    image = axes[0].images[0]
    assert np.ma.getmaskarray(image.get_array())[:5].all()
    assert (image.cmap(image.norm(image.get_array()))[:5, :, 3] == 0).all()
    assert fig.axes[1].get_ylabel() in ("rad", "mm", "periods")


def test_error_is_centred_on_zero():
    _, axes = plotting.panels(1)
    plotting.error(axes[0], np.array([[-0.1, 0.5]]))
    low, high = axes[0].images[0].get_clim()
    assert low == -high


def test_embree_draws_what_is_there():
    image = plotting._by_embree(SCENE, *VIEW)
    assert image.shape == (240, 320, 4) and image.dtype == np.uint8
    red = (image[..., 0] > 100) & (image[..., 1] < 80)
    assert red.any() and (image[..., 3] == 0).mean() > 0.3


@pytest.mark.slow
def test_pyvista_and_embree_see_the_same_outline():
    if not pyvista_works():
        pytest.skip("PyVista cannot render off screen here")
    masks = [
        draw(SCENE, *VIEW)[..., 3] > 127 for draw in (plotting._by_pyvista, plotting._by_embree)
    ]
    assert (masks[0] != masks[1]).mean() < 0.02


def test_nothing_to_draw():
    with pytest.raises(ValueError, match="no mesh given"):
        plotting.bodies([], *VIEW)


def test_frustum_reaches_where_it_says(tiny):
    mesh = plotting.frustum(tiny.system.camera, 300.0)
    assert mesh.vertices[:, 2].max() == pytest.approx(300, abs=3)


def test_ticks_stand_where_asked_and_nowhere_else():
    _, ax = plotting.plt.subplots()
    ax.set(xscale="log", xlim=(0.01, 300))
    plotting.ticks(ax, (0.03, 15, 114))
    assert [label.get_text() for label in ax.get_xticklabels()] == ["0.03", "15", "114"]
    assert not len(ax.get_xticks(minor=True))


def contrast(a, b) -> float:
    """Of two colours, as WCAG 2 defines it."""
    rgb = np.array([matplotlib.colors.to_rgb(colour) for colour in (a, b)])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    low, high = sorted(linear @ (0.2126, 0.7152, 0.0722))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("ground", ["#ffffff", "#121212"])
def test_lines_and_letters_are_seen_on_white_and_on_a_dark_page(ground):
    assert contrast(plotting.INK, ground) > 4.3
    assert min(contrast(colour, ground) for colour in plotting.COLOURS) > 3.4


def test_a_figure_has_no_ground_and_no_black_of_its_own():
    fig, ax = plotting.plt.subplots(figsize=(3, 2))
    ax.plot([0, 1], [0, 1], label="a line")
    ax.set(title="title", xlabel="x, mm", ylabel="y, mm")
    ax.annotate("here", (0.5, 0.5), (0.2, 0.8), arrowprops={"arrowstyle": "->"})
    ax.boxplot([[1, 2, 3, 9]])
    ax.legend()
    fig.canvas.draw()
    picture = np.asarray(fig.canvas.buffer_rgba())
    drawn = picture[..., 3] > 200
    assert (picture[..., 3] == 0).mean() > 0.7
    assert drawn.any() and (picture[drawn][:, :3].max(axis=-1) > 100).all()
