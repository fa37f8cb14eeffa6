"""The one figure style of the book, and its pictures of phases, errors, depths and bodies.

Phase that wraps is drawn in a cyclic colour map, absolute phase and depth in sequential ones,
signed error in a diverging one centred on zero. Pixels outside the mask stay blank. What lies
around a picture is transparent.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import trimesh
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from fpputil.optics.pinhole import Pinhole, looking
from fpputil.optics.raycasting import bvh, raycast
from fpputil.optics.system import System

# A picture has no ground of its own: it lies on white paper and on a dark page (#121212). INK has
# the same contrast, 4.3 : 1, with both; each of COLOURS has 3.4 : 1 or more.
INK = "#797979"
COLOURS = ("#2e86c1", "#d35400", "#1e8449", "#9b59b6", "#a8870a", "#5d6d7e")

plt.rcParams.update(
    {
        "figure.dpi": 150,
        "figure.constrained_layout.use": True,
        "font.size": 9,
        "axes.titlesize": 9,
        "axes.prop_cycle": plt.cycler(color=COLOURS),
        "axes.grid": True,
        "grid.alpha": 0.25,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "image.interpolation": "nearest",
        "legend.frameon": False,
        "figure.facecolor": "none",
        "axes.facecolor": "none",
        **dict.fromkeys(
            ["text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"], INK
        ),
        **dict.fromkeys(["grid.color", "patch.edgecolor", "hatch.color"], INK),
        **{f"boxplot.{part}props.color": INK for part in ("box", "cap", "whisker", "flier")},
        "boxplot.flierprops.markeredgecolor": INK,
        **{f"axes3d.{axis}axis.panecolor": (0.5, 0.5, 0.5, 0.1) for axis in "xyz"},
    }
)


def panels(columns: int, rows: int = 1, width: float = 8.0, aspect: float = 0.75):
    """A figure of pictures in a grid.

    Parameters
    ----------
    columns, rows : int
        Number of pictures across and down.
    width : float
        Of the whole figure, inches.
    aspect : float
        Height over width of one picture.

    Returns
    -------
    fig, axes
        matplotlib Figure and a flat array of its Axes.

    Examples
    --------
    >>> fig, axes = panels(columns=3)
    >>> axes.shape
    (3,)
    >>> plt.close(fig)
    """
    height = rows * (width / columns * aspect * 0.82 + 0.35)
    fig, axes = plt.subplots(rows, columns, figsize=(width, height), squeeze=False)
    return fig, axes.ravel()


def frame(ax: Axes, image: np.ndarray, title: str = "", top: float = 255) -> None:
    """A photograph (H, W) in grey levels, or a coloured picture (H, W, 3 or 4)."""
    ax.imshow(image, cmap="gray", vmin=0, vmax=top)
    _bare(ax, title)


def wrapped(ax: Axes, phi: np.ndarray, title: str = "wrapped phase") -> None:
    """A wrapped phase (H, W), radians, in a cyclic colour map."""
    bar = _map(ax, phi, title, "twilight", -np.pi, np.pi, "rad")
    bar.set_ticks([-np.pi, 0, np.pi], labels=["-π", "0", "π"])


def absolute(ax: Axes, Phi: np.ndarray, title: str = "absolute phase") -> None:
    """An absolute phase (H, W), radians."""
    _map(ax, Phi, title, "viridis", None, None, "rad")


def depth(ax: Axes, z: np.ndarray, title: str = "depth") -> None:
    """A depth map (H, W), mm; near is bright."""
    _map(ax, z, title, "cividis_r", None, None, "mm")


def error(ax: Axes, e: np.ndarray, title: str = "error", unit="rad", limit=None) -> None:
    """A signed error (H, W), white at zero; `limit` defaults to the 99th percentile of ``|e|``."""
    if limit is None:
        limit = float(np.nanpercentile(np.abs(e), 99)) or 1.0
    _map(ax, e, title, "RdBu_r", -limit, limit, unit)


def quantity(ax: Axes, values: np.ndarray, title: str, unit: str, low=None, high=None) -> None:
    """Any other map (H, W) on a sequential scale."""
    _map(ax, values, title, "viridis", low, high, unit)


def orders(ax: Axes, K: np.ndarray, title: str = "fringe order") -> None:
    """A fringe-order map (H, W)."""
    bar = _map(ax, K, title, "viridis", None, None, "periods")
    bar.locator = MaxNLocator(integer=True)
    bar.update_ticks()


def ticks(ax: Axes, values: Sequence[float]) -> None:
    """Ticks at these values of a logarithmic x axis, as plain numbers, and at no others."""
    ax.set_xticks(values, labels=[f"{value:g}" for value in values])
    ax.minorticks_off()


def _map(ax, values, title, cmap, low, high, unit):
    image = ax.imshow(np.asarray(values, np.float64), cmap=cmap, vmin=low, vmax=high)
    _bare(ax, title)
    return ax.figure.colorbar(image, ax=ax, label=unit, fraction=0.046, pad=0.03)


def _bare(ax, title):
    ax.set(xticks=[], yticks=[], title=title)
    ax.grid(False)
    ax.spines[:].set_visible(False)


def bodies(
    meshes: Sequence[tuple[trimesh.Trimesh, str]],
    look_from,
    look_at,
    size: tuple[int, int] = (960, 640),
    angle: float = 30.0,
) -> np.ndarray:
    """Picture of meshes in space, by PyVista, or shaded by Embree where PyVista cannot draw.

    Parameters
    ----------
    meshes : sequence of (trimesh.Trimesh, colour)
        World coordinates, mm; matplotlib's names of colours.
    look_from, look_at, size, angle
        As for `fpputil.optics.pinhole.looking`.

    Returns
    -------
    (H, W, 4) uint8 array
        Red, green, blue and opacity, which is 0 where no mesh is.
    """
    from fpputil.probe import pyvista_works

    if not meshes:
        raise ValueError("no mesh given; a picture needs at least one")
    draw = _by_pyvista if pyvista_works() else _by_embree
    return draw(meshes, np.asarray(look_from, float), np.asarray(look_at, float), size, angle)


def wires(segments, radius: float = 1.2) -> trimesh.Trimesh:
    """Line segments, (S, 2, 3), mm, as one mesh of thin rods."""
    rods = [trimesh.creation.cylinder(radius, segment=s, sections=8) for s in np.asarray(segments)]
    return trimesh.util.concatenate(rods)


def frustum(pinhole: Pinhole, reach: float, radius: float = 1.2) -> trimesh.Trimesh:
    """The edges of what a pinhole sees or lights up to `reach` mm, as rods.

    Examples
    --------
    >>> from fpputil.optics import preset
    >>> int(frustum(preset("paper").system.camera, reach=300).bounds[1, 2].round(-1))
    300
    """
    w, h = pinhole.width - 0.5, pinhole.height - 0.5
    corners = np.array([(-0.5, -0.5), (w, -0.5), (w, h), (-0.5, h)])
    ends = pinhole.centre + reach * pinhole.rays(corners)
    rays = [(pinhole.centre, end) for end in ends]
    return wires(rays + list(zip(ends, np.roll(ends, -1, axis=0), strict=True)), radius)


def _by_pyvista(meshes, look_from, look_at, size, angle):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # tqdm, which it brings along, asks for Jupyter's widgets
        import pyvista

    plotter = pyvista.Plotter(off_screen=True, window_size=list(size), lighting="three lights")
    for mesh, colour in meshes:
        plotter.add_mesh(pyvista.wrap(mesh), color=colour, smooth_shading=False, specular=0.1)
    plotter.camera.position, plotter.camera.focal_point = tuple(look_from), tuple(look_at)
    plotter.camera.up, plotter.camera.view_angle = (0.0, -1.0, 0.0), angle
    plotter.renderer.reset_camera_clipping_range()
    plotter.enable_anti_aliasing("ssaa")
    image = np.asarray(plotter.screenshot(return_img=True, transparent_background=True))
    plotter.close()
    return image


def _by_embree(meshes, look_from, look_at, size, angle):
    """The same picture from our own ray caster: the lamp stands at the eye."""
    eye = looking(look_from, look_at, size, angle)
    whole = trimesh.util.concatenate([m for m, _ in meshes])
    colours = np.array([plt.matplotlib.colors.to_rgb(c) for _, c in meshes])
    owner = np.repeat(np.arange(len(meshes)), [len(m.faces) for m, _ in meshes])
    far = np.linalg.norm(whole.vertices - look_from, axis=1).max()
    system, tree = System(eye, eye, 1.0, 2 * far + 1), bvh(whole)
    light = [raycast(tree, system, albedo=0.3 + 0.7 * c, white_at=1.0) for c in colours[owner].T]
    distance = np.linalg.norm(eye.rays(), axis=-1) * light[0].depth
    rgb = np.stack([v.shade * distance**2 for v in light], -1)
    rgba = np.concatenate([255 * rgb, np.where(light[0].mask, 255, 0)[..., None]], axis=-1)
    return np.clip(np.nan_to_num(rgba), 0, 255).astype(np.uint8)
