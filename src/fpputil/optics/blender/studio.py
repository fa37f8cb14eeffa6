"""Blender, empty, with a camera set up: where `fpputil.optics.blender` takes pictures.

Blender's world is the system's world in metres; only the local axes of its cameras and lamps
differ (see `fpputil.optics.system.from_blender`).
"""

import ctypes
import importlib.util
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from fpputil import probe
from fpputil.optics.pinhole import Pinhole

METRE = 1000.0
SENSOR = 100.0  # any width will do: the lens is scaled to it; Blender takes no lens below 1 mm


def load_blender():
    """The module ``bpy``, or an ImportError that says why it does not run."""
    if probe.blender_works():
        import bpy

        return bpy
    if os.environ.get("FPP_BLENDER") == "0":
        why = "is switched off by FPP_BLENDER=0; unset it to use Blender"
    elif importlib.util.find_spec("bpy") is None:
        why = (
            "is not installed; pip install 'fpputil[blender]' brings it for Python 3.11 and 3.13 "
            f"(this is {sys.version_info.major}.{sys.version_info.minor})"
        )
    else:
        why = f"does not start here; on Debian, apt install {probe.PACKAGES['bpy']}"
    raise ImportError(f"bpy, Blender as a Python module, {why}")


@contextmanager
def opened(camera: Pinhole, samples: int) -> Iterator[tuple]:
    """Blender, empty, with the camera set up: yields ``bpy`` and a function that photographs.

    That function takes nothing and returns linear light, (H, W, 4) float32: red, green, blue
    and the share of the pixel that a surface covers. One sample goes through the centre of the
    pixel; more are spread by Cycles' own filter.
    """
    if camera.distortion.any() or camera.K[0, 1] != 0:
        raise ValueError(
            f"a camera with distortion {camera.distortion.tolist()} and skew {camera.K[0, 1]:g} "
            "given; Blender's camera has neither, the ray caster has both"
        )
    if min(camera.width, camera.height) < 4:
        raise ValueError(
            f"a camera of {camera.width} x {camera.height} pixels given; Blender's has at least "
            "4 x 4"
        )
    bpy = load_blender()
    with _silence(), tempfile.TemporaryDirectory() as folder:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        try:
            scene = bpy.context.scene
            _set_film(scene.render, camera, Path(folder) / "picture.exr")
            _set_cycles(scene, samples)
            scene.camera = add(bpy, _lens(bpy, camera), camera)
            yield bpy, partial(_photograph, bpy)
        finally:
            bpy.ops.wm.read_factory_settings(use_empty=True)


def solid(bpy, triangles: np.ndarray, material, **values: np.ndarray):
    """Triangles (F, 3, 3), mm, of one material; each of ``values``, (F,), is read by its name.

    Each triangle has corners of its own, so that Blender has nothing to merge or to smooth.
    """
    corners = np.ascontiguousarray(triangles.reshape(-1, 3) / METRE, np.float32)
    mesh = bpy.data.meshes.new("solid")
    mesh.vertices.add(len(corners))
    mesh.loops.add(len(corners))
    mesh.polygons.add(len(triangles))
    mesh.vertices.foreach_set("co", corners.ravel())
    mesh.loops.foreach_set("vertex_index", np.arange(len(corners), dtype=np.int32))
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
    for name, value in values.items():
        layer = mesh.attributes.new(name, "FLOAT", "FACE")
        layer.data.foreach_set("value", np.ascontiguousarray(value, np.float32))
    mesh.update(calc_edges=True)
    mesh.materials.append(material)
    thing = bpy.data.objects.new("solid", mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def add(bpy, data, pinhole: Pinhole):
    """A camera or lamp, put where the pinhole is."""
    thing = bpy.data.objects.new(data.name, data)
    thing.rotation_mode = "QUATERNION"  # a half turn is then exact in float32
    pose = np.eye(4)
    pose[:3, :3] = pinhole.R.T @ np.diag([1.0, -1.0, -1.0])
    pose[:3, 3] = pinhole.centre / METRE
    thing.matrix_world = pose.T.tolist()  # Blender reads lists column by column
    bpy.context.scene.collection.objects.link(thing)
    return thing


def _lens(bpy, camera: Pinhole):
    """The camera's data block: focal length, and the principal point as a shift."""
    (fx, _, cx), (_, fy, cy) = camera.K[:2].tolist()
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit, lens.sensor_width = "HORIZONTAL", SENSOR
    lens.lens = SENSOR * fx / camera.width
    lens.shift_x = ((camera.width - 1) / 2 - cx) / camera.width
    lens.shift_y = (cy - (camera.height - 1) / 2) / camera.width * fx / fy
    lens.clip_start, lens.clip_end = 1e-4, 1e5
    return lens


def _set_film(render, camera: Pinhole, path: Path) -> None:
    fx, fy = camera.K[0, 0], camera.K[1, 1]
    render.resolution_x, render.resolution_y = camera.width, camera.height
    render.resolution_percentage = 100
    render.pixel_aspect_x, render.pixel_aspect_y = max(1.0, fy / fx), max(1.0, fx / fy)
    render.film_transparent = True
    render.use_persistent_data = True
    render.filepath = str(path)
    form = render.image_settings
    form.file_format, form.color_mode, form.color_depth = "OPEN_EXR", "RGBA", "32"
    form.exr_codec = "NONE"


def _set_cycles(scene, samples: int) -> None:
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.pixel_filter_type = "BLACKMAN_HARRIS"
    cycles.filter_width = 0.01 if samples == 1 else 1.5
    cycles.max_bounces = 0
    cycles.light_sampling_threshold = 0.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0


def _photograph(bpy) -> np.ndarray:
    path = bpy.context.scene.render.filepath
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    light = np.empty(4 * width * height, np.float32)
    image.pixels.foreach_get(light)
    bpy.data.images.remove(image)
    return light.reshape(height, width, 4)[::-1]


@contextmanager
def _silence() -> Iterator[None]:
    """Keep what Blender prints, past Python, out of the standard output."""
    flush = ctypes.CDLL(None).fflush
    sys.stdout.flush()
    flush(None)
    kept = os.dup(1)
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        flush(None)
        os.dup2(kept, 1)
        os.close(kept)
