"""Real light: photographs of a real projector, decoded by the multi-wavelength method.

Three pitches that stand as 14 : 15 : 16, twelve steps each. The photographs are not part of the
project: set FPP_CAPTURES to their folder, or keep it at ../shared/captures.
"""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from fpputil.decoding import phase, unwrap

ROOT = Path(__file__).parents[2]
CAPTURES = Path(os.environ.get("FPP_CAPTURES", ROOT.parent / "shared" / "captures"))
PITCHES = (14, 15, 16)
WIDTH = 1000  # columns of these pitches in view; the beat of all three is 1680 long


def decode(scene: str):
    phis, strong = [], True
    for pitch in PITCHES:
        files = [CAPTURES / scene / f"period{pitch}_step{n:02d}.png" for n in range(12)]
        frames = np.stack([cv2.imread(str(f), cv2.IMREAD_GRAYSCALE) for f in files])
        M, D = phase.numerator_denominator(frames)
        phis.append(phase.wrapped_phase(M, D))
        strong = strong & (phase.modulation(M, D, 12) > 10)
    Phi = unwrap.mw_tpu(phis, PITCHES, WIDTH)
    columns = [P * p / (2 * np.pi) for P, p in zip(Phi, PITCHES, strict=True)]
    return np.stack(columns), strong


@pytest.mark.skipif(not CAPTURES.is_dir(), reason=f"no real captures at {CAPTURES.name}/")
@pytest.mark.parametrize("scene", ["david", "bottle"])
def test_three_pitches_agree_on_the_column(scene):
    columns, strong = decode(scene)
    spread = np.ptp(columns[:, strong], axis=0)
    assert strong.mean() > 0.05
    assert (spread < 1).mean() >= 0.997
