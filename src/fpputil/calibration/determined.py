"""What makes a calibration doubtful: poses that do not determine the system (chapter 12)."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from fpputil.calibration.stereo import BoardView, StereoFit
from fpputil.optics.system import System

FEW_POSES = 8
LEAST_TILT = 5.0  # degrees, RMS, by which the boards' normals must vary both ways
LEAST_COVER = 0.3  # share of the camera's picture
LEAST_SURE = 0.005  # relative standard deviation of a focal length


def poorly_determined(fit: StereoFit, seen: Sequence[BoardView], system: System) -> tuple[str, ...]:
    """Why the poses may not determine the system that was fitted to them, in sentences."""
    found = []
    normals = Rotation.from_rotvec(fit.poses[:, :3]).as_matrix()[:, :, 2]
    spread = np.linalg.svd(normals - normals.mean(axis=0), compute_uv=False)[1]
    tilt = np.degrees(spread / np.sqrt(len(normals)))
    if tilt < LEAST_TILT:
        found.append(
            f"the boards' normals vary by {tilt:.1f} degrees (RMS) in one direction; "
            f"{LEAST_TILT:g} or more both ways are needed, or focal length and depth trade places"
        )
    if len(seen) < FEW_POSES:
        found.append(f"{len(seen)} poses were used; with fewer than {FEW_POSES} chance weighs much")
    hull = cv2.convexHull(np.concatenate([s.camera for s in seen]).astype(np.float32))
    cover = cv2.contourArea(hull) / (system.camera.width * system.camera.height)
    if cover < LEAST_COVER:
        found.append(
            f"the points cover {100 * cover:.0f} % of the picture; beyond them the distortion "
            f"is a guess, so bring the board to the picture's edges"
        )
    for k, who in enumerate(("camera", "projector")):
        share = max(fit.sigma[f"{who} {f}"] / fit.lenses[k, n] for n, f in enumerate(("fx", "fy")))
        if share > LEAST_SURE:
            found.append(f"the focal length of the {who} is sure to {100 * share:.1f} % only")
    near, far = fit.poses[:, 5].min(), fit.poses[:, 5].max()
    if far < system.z_min or near > system.z_max:
        found.append(
            f"the boards stand {near:.0f} to {far:.0f} mm away, outside the measuring range of "
            f"{system.z_min:g} to {system.z_max:g} mm; is the size of the board right?"
        )
    return tuple(found)
