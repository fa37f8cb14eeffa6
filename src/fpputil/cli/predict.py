"""`fpp predict`: depth from the few photographs that a trained network wants (chapter 8)."""

import io
import json as jsons
import sys
from pathlib import Path
from typing import Annotated

from fpputil import decoding, learning, optics
from fpputil.cli.options import (
    Channel,
    Device,
    Force,
    Full,
    Json,
    Out,
    Precision,
    System,
    Weights,
    option,
)

FILES = ("predicted.npz", "points.ply", "predicted.png")
ARRAYS = ("Phi", "column", "depth", "phi_h", "phi_r", "mask", "Phi_error", "depth_error")
OUTSIDE = 0.05  # of the pixels with fringes, from which a warning tells that they have no depth


def predict(
    photo: Annotated[list[Path], option("Photographs.")],
    /,
    *,
    weights: Weights,
    system: System,
    out: Out,
    device: Device = "cpu",
    precision: Precision = "auto",
    full: Full = None,
    channel: Channel = "grey",
    most: Annotated[float | None, option("Leave out points that may be off by more mm.")] = None,
    accept: Annotated[bool, option("Write depth all the same.")] = False,
    json: Json = False,
    force: Force = False,
) -> None:
    """Depth from photographs by a trained network.

    Photographs in the order in which the network wants them: of SFNet that of the high pitch, then
    that of its reference's (a wrong number is answered by what is wanted). PNG, BMP, TIFF, NPY,
    PGM, JPEG; colours become grey, and how many bits there are in 16, or whether floats reach to
    1, is told by the greatest level of all photographs, or by --full. Writes predicted.npz (Phi,
    column, depth, phi_h, phi_r, Phi_error, depth_error: float32, NaN outside mask), points.ply
    (within the measuring range, in the first photograph's grey, each with its error) and
    predicted.png. Of the errors 95 % stay below those told, where the JSON beside WEIGHTS says how
    to tell (`fpp evaluate --uncertainty` finds it); they are NaN otherwise.

    The mask is a guess: so few photographs do not tell what is lit. It takes pixels around which
    crests and troughs of the photographs differ by more than 16 grey levels of 255. Shadows
    narrower than 1.25 periods are taken in, and rims are uncertain by half a period. A network
    answers everywhere, right or wrong: what is unlike its training is warned of. Photographs in
    another order, or most pixels outside the measuring range, are an error, unless --accept.
    """
    import numpy as np

    from fpputil.checks import positive
    from fpputil.files import folder_whole, write_arrays, write_whole

    trained, rig = learning.load_weights(weights), optics.load_system(system)
    frames, notes = _frames(photo, full, channel)
    shots = learning.check_photographs(trained, frames, rig)
    warnings = [
        said for fault in learning.wrong_photographs(shots) for said in _tell(fault, accept)
    ]
    warnings += _warn(notes + learning.warnings(shots))
    told = learning.uncertainty_of(weights)
    if most is not None and told is None:
        raise ValueError(
            f"--most {most:g} given, and nothing beside {weights} tells how far off a point may "
            "be; `fpp evaluate --json --uncertainty` finds it on a dataset"
        )
    with folder_whole(out, "fpp predict", force, [*photo, weights]) as folder:
        result = learning.predict(trained, shots, device, precision, told)
        inside = np.isfinite(result.points).all(axis=-1)
        pixels, mask = result.mask.size, int(result.mask.sum())
        if (outside := 1 - inside.sum() / mask) > OUTSIDE:
            lost = f"{outside:.0%} of the pixels with fringes have no depth of {rig.z_min:g}"
            lost += f" to {rig.z_max:g} mm; fringe orders may be wrong, here and elsewhere"
            warnings += _tell(lost, accept or outside < 0.5)
        if most is not None:
            inside &= result.depth_error <= positive("most", most, "mm")
            if not inside.any():
                best = np.nanmin(result.depth_error)
                raise ValueError(f"no point is known to {most:g} mm; the best is to {best:.2g} mm")
        depths = np.percentile(result.depth[inside], [0, 50, 100]).tolist()
        points = int(inside.sum())
        write_arrays(folder / FILES[0], {name: getattr(result, name) for name in ARRAYS})
        grey = np.rint(shots.frames[0].clip(0, 255)).astype(np.uint8)
        colours = np.repeat(grey[inside][:, None], 3, axis=1)
        cloud, error = result.points[inside], {"error": result.depth_error[inside]}
        decoding.save_ply(folder / FILES[1], cloud, colours, error if told else None)
        write_whole(folder / FILES[2], _picture(shots.frames, result))
    if json:
        numbers = {"pixels": pixels, "mask": mask, "points": points}
        numbers["depth_mm"] = dict(zip(("least", "median", "greatest"), depths, strict=True))
        print(jsons.dumps(numbers | {"out": str(out), "warnings": warnings}, indent=1))
        return
    print(f"fringes in {mask} of {pixels} pixels, {points} points")
    print("depth {0:.1f} to {2:.1f} mm, median {1:.1f}".format(*depths))
    print(f"written to {out}: {', '.join(FILES)}")


def _frames(photo: list[Path], full: float | None, channel: str) -> tuple[list, list[str]]:
    """Photographs in float32 grey levels of 255, and what is to be said of their levels."""
    from fpputil.capture.files.images import grey, levels_of, read_pixels
    from fpputil.checks import positive

    images = [read_pixels(path) for path in photo]
    if full is not None:
        scales, notes = dict.fromkeys({i.dtype for i in images}, positive("full", full)), []
    else:
        kinds = dict.fromkeys(image.dtype for image in images)
        levels = {kind: levels_of(i for i in images if i.dtype == kind) for kind in kinds}
        scales = {kind: level.full for kind, level in levels.items()}
        said = [level.said for level in levels.values() if level.said]
        notes = [f"photographs taken for {text}; --full tells otherwise" for text in said]
    frames = [grey(i, channel).astype("float32") * 255 / scales[i.dtype] for i in images]
    return frames, notes


def _warn(sentences: list[str]) -> list[str]:
    for sentence in sentences:
        print(f"warning: {sentence}", file=sys.stderr)
    return sentences


def _tell(fault: str, accepted: bool) -> list[str]:
    """The fault as a warning if it is accepted, else as an error."""
    if not accepted:
        raise ValueError(f"{fault}; --accept measures all the same")
    return _warn([fault])


def _picture(frames, result) -> bytes:
    """Photographs, absolute phase and depth as PNG, without a window."""
    import numpy as np
    from matplotlib.figure import Figure

    from fpputil import plotting

    number = len(frames) + 2
    figure = Figure(figsize=(3.2 * number, 2.8), layout="constrained")
    axes = figure.subplots(1, number)
    for k, (ax, frame) in enumerate(zip(axes, frames, strict=False), 1):
        plotting.frame(ax, frame, f"photograph {k}")
    plotting.absolute(axes[-2], result.Phi)
    inside = np.isfinite(result.points).all(axis=-1)
    plotting.depth(axes[-1], np.where(inside, result.depth, np.nan), "depth in the measuring range")
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    return picture.getvalue()
