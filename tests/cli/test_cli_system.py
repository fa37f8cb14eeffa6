"""`fpp system`: what it prints against the geometry, and that a system comes back as it was."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fpputil.cli.system import describe
from fpputil.optics.system import System, preset


def test_show_is_the_design(fpp):
    numbers = json.loads(fpp("system", "show", "tiny", "--json")[1])
    assert numbers["camera"]["focal_px"] == pytest.approx([12 / 7.2 * 160] * 2)
    pose = numbers["projector_from_camera"]
    assert pose["position_mm"] == pytest.approx([45, 0, 150], abs=1e-9)
    angles = [pose[k] for k in ("yaw_deg", "pitch_deg", "roll_deg")]
    assert angles == pytest.approx([-5, 0, 0], abs=1e-9)  # turned in: to the left
    assert numbers["axes_nearest"] == pytest.approx({"depth_mm": 664.35, "gap_mm": 0}, abs=0.01)
    assert numbers["field_of_view_mm"]["480"] == pytest.approx([480 * 0.6, 480 * 0.45])
    assert numbers["columns_per_mm"]["top left"] == pytest.approx(0.425, abs=0.01)
    assert 0.15 < numbers["columns_per_mm"]["share_of_too_few"] < 0.25
    assert "measuring range mm                     480, 820" in fpp("system", "show", "tiny")[1]


def test_the_camera_need_not_be_the_world_and_axes_may_be_parallel():
    system = preset("tiny").system
    R, t = Rotation.from_euler("xyz", (20, -30, 70), degrees=True).as_matrix(), (10.0, -70.0, 5.0)
    pair = (system.camera, system.projector)
    moved = [replace(p, R=p.R @ R.T, t=p.t - p.R @ R.T @ t) for p in pair]
    before, after = describe(system), describe(System(*moved, system.z_min, system.z_max))
    for key in ("projector_from_camera", "axes_nearest", "columns_per_mm", "field_of_view_mm"):
        for name, value in before[key].items():
            np.testing.assert_allclose(after[key][name], value, atol=1e-6, err_msg=name)
    side = replace(system.projector, R=np.eye(3), t=-np.array([30.0, 40.0, 0.0]))
    near = describe(System(system.camera, side, 480.0, 820.0))["axes_nearest"]
    assert near == {"depth_mm": None, "gap_mm": 50.0}


def test_convert_there_and_back(tmp_path, fpp):
    first, second = tmp_path / "a.yml", tmp_path / "b.json"
    assert "is in " in fpp("system", "convert", "tiny", first)[1]
    for _ in range(2):
        assert fpp("system", "convert", first, second, "--force")[0] == 0
    assert fpp("system", "show", second)[1] == fpp("system", "show", "tiny")[1]
