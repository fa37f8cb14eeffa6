"""`fpp predict`: depth from the few photographs that a trained network wants (chapter 8)."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

FILES = ("predicted.npz", "points.ply", "predicted.png")
ARRAYS = ("Phi", "column", "depth", "phi_h", "phi_r", "mask")
OUTSIDE = 0.05  # of the pixels with fringes may lie outside the measuring range without a word


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    predict = commands.add_parser(
        "predict",
        help="depth from photographs by a trained network",
        description="Photographs in the order in which the network wants them: of SFNet that of "
        "the high pitch, then that of its reference's (wrong numbers of photographs are answered "
        "by what is wanted). PNG, BMP, TIFF and NPY; colours become grey, 16 bits are divided by "
        "257, floats count as grey levels 0 to 255. Writes predicted.npz (Phi, column, depth, "
        "phi_h, phi_r: float32, NaN outside mask), points.ply (points within the measuring range, "
        "in the first photograph's grey) and predicted.png.",
        epilog="The mask is a guess: so few photographs do not tell what is lit. It takes pixels "
        "around which crests and troughs of the photographs differ by more than 16 grey levels of "
        "255. Shadows narrower than 1.25 periods are taken in, and rims are uncertain by half a "
        "period. A network answers everywhere, right or wrong, and does not say how sure it is: "
        "what is unlike its training is warned of, and the exit code stays 0.",
    )
    predict.add_argument("photographs", metavar="PHOTO", nargs="+", type=Path)
    predict.add_argument("--weights", type=Path, required=True, metavar="W.safetensors")
    predict.add_argument("--system", required=True, metavar="S",
                         help="tiny, small, paper, or a system file")  # fmt: skip
    predict.add_argument("--out", type=Path, required=True, metavar="DIR", help="new folder")
    predict.add_argument("--device", default="cpu", help="cpu, cuda ... (default cpu)")
    predict.add_argument("--precision", default="auto", help="float32, bfloat16 or auto (default)")
    predict.add_argument("--json", action="store_true", help="print the numbers as a JSON object")
    predict.add_argument("--force", action="store_true", help="replace an earlier prediction")
    predict.set_defaults(run=_predict, go_on="nothing was written")


def _predict(options) -> None:
    from fpputil.files import folder_whole
    from fpputil.learning.prediction import check_photographs, predict, warnings
    from fpputil.learning.weights import load_weights
    from fpputil.optics.system import load_system

    _replaceable(options.out, options.force)
    trained, system = load_weights(options.weights), load_system(options.system)
    shown = check_photographs(trained, [_levels(path) for path in options.photographs], system)
    warnings = warnings(shown)
    _warn(warnings)
    with folder_whole(options.out, options.force) as folder:
        found = predict(trained, shown, options.device, options.precision)
        about = _numbers(found)
        late = _outside(about, system)
        _warn(late)
        _write(folder, shown.frames, found)
    _say(options, about | {"out": str(options.out), "warnings": warnings + late})


def _replaceable(out: Path, force: bool) -> None:
    """ValueError if --force would delete what no prediction has written."""
    if not force or not out.is_dir():
        return
    if other := sorted({entry.name for entry in out.iterdir()} - set(FILES)):
        raise ValueError(f"--out {out} holds {other[0]}, which is of no prediction; it stays")


def _levels(path: Path):
    """A photograph in float32 grey levels of 255; floats are that already."""
    import numpy as np

    from fpputil.capture.photographs import read_photograph

    image = read_photograph(path)
    return image.astype(np.float32) / (257 if image.dtype == np.uint16 else 1)


def _warn(sentences) -> None:
    for sentence in sentences:
        print(f"warning: {sentence}", file=sys.stderr)


def _numbers(found) -> dict:
    """What was found, in numbers."""
    import numpy as np

    inside = np.isfinite(found.points).all(axis=-1)
    depths = np.percentile(found.depth[inside], [0, 50, 100]).tolist()
    return {
        "pixels": found.mask.size,
        "mask": int(found.mask.sum()),
        "points": int(inside.sum()),
        "depth_mm": dict(zip(("least", "median", "greatest"), depths, strict=True)),
    }


def _outside(about, system) -> list[str]:
    share = 1 - about["points"] / about["mask"]
    if share <= OUTSIDE:
        return []
    return [
        f"{share:.0%} of the pixels with fringes have no depth of {system.z_min:g} to "
        f"{system.z_max:g} mm; fringe orders may be wrong, here and elsewhere"
    ]


def _write(folder: Path, frames, found) -> None:
    import numpy as np

    from fpputil.decoding.pointcloud import point_cloud, save_ply
    from fpputil.files import write_arrays, write_whole

    write_arrays(folder / FILES[0], {name: getattr(found, name) for name in ARRAYS})
    grey = np.rint(frames[0].clip(0, 255)).astype(np.uint8)
    colours = np.repeat(grey[np.isfinite(found.points).all(axis=-1)][:, None], 3, axis=1)
    save_ply(folder / FILES[1], point_cloud(found.points), colours)
    write_whole(folder / FILES[2], _picture(frames, found))


def _picture(frames, found) -> bytes:
    """Photographs, absolute phase and depth as PNG, without a window."""
    import numpy as np
    from matplotlib.figure import Figure

    from fpputil import plotting

    number = len(frames) + 2
    figure = Figure(figsize=(3.2 * number, 2.8), layout="constrained")
    axes = figure.subplots(1, number)
    for k, (ax, frame) in enumerate(zip(axes, frames, strict=False), 1):
        plotting.frame(ax, frame, f"photograph {k}")
    plotting.absolute(axes[-2], found.Phi)
    inside = np.isfinite(found.points).all(axis=-1)
    plotting.depth(axes[-1], np.where(inside, found.depth, np.nan), "depth in the measuring range")
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    return picture.getvalue()


def _say(options, about) -> None:
    if options.json:
        print(json.dumps(about, indent=1))
        return
    least, median, greatest = about["depth_mm"].values()
    print(f"fringes in {about['mask']} of {about['pixels']} pixels, {about['points']} points")
    print(f"depth {least:.1f} to {greatest:.1f} mm, median {median:.1f}")
    print(f"written to {options.out}: {', '.join(FILES)}")
