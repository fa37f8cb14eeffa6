"""Systems in the files of others: one system, written as each of them writes it."""

import json

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fpputil.optics.opencv_files import matrices_of, read_entries, rotation_of
from fpputil.optics.system import System, assemble_system, preset

TRUE = preset("small").system
K, D = {1: TRUE.camera.K, 2: TRUE.projector.K}, {1: [0.1, -0.2, 1e-3, 0, 0], 2: np.zeros(5)}
R, T = TRUE.projector.R, TRUE.projector.t
SIZES = ["--camera", "320x240", "--projector", "912x1140"]


def stereo(*names):
    """Names of K, D of the camera, of the projector, and of R and T."""
    values = (K[1], D[1], K[2], D[2], R, T[:, None])
    return {name: np.asarray(v, float) for name, v in zip(names, values, strict=True)}


OTHERS = {
    "stereo_calib.cpp": stereo("M1", "D1", "M2", "D2", "R", "T"),
    "structured_light": stereo("cam1_intrinsics", "cam1_distorsion", "cam2_intrinsics",
                               "cam2_distorsion", "R", "T"),
    "projector and camera": stereo("cam_K", "cam_kc", "proj_K", "proj_kc", "R", "T"),
    "stereoCalibrate": stereo("cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2",
                              "R", "T"),
    "Python": stereo("K1", "dist1", "K2", "dist2", "R", "T"),
}  # fmt: skip


def opencv(path, entries):
    store = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in entries.items():
        store.write(name, value)
    store.release()
    return path


def same(system, digits=1e-9):
    for own, true in ((system.camera, TRUE.camera), (system.projector, TRUE.projector)):
        for name in ("K", "R", "t"):
            np.testing.assert_allclose(getattr(own, name), getattr(true, name), atol=digits)
        assert (own.width, own.height) == (true.width, true.height)
    np.testing.assert_allclose(system.camera.distortion, D[1])
    assert (system.z_min, system.z_max) == (480, 820)


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
@pytest.mark.parametrize("entries", OTHERS.values(), ids=OTHERS)
def test_a_system_of_another_program_is_converted(fpp, refused, tmp_path, entries, suffix):
    path, out = tmp_path / f"calib.{suffix}", tmp_path / "mine.json"
    if suffix == "json":
        path.write_text(json.dumps({k: v.tolist() for k, v in entries.items()}), encoding="utf-8")
    else:
        opencv(path, entries)
    said = refused("system", "show", path)
    assert "of another program, and no measuring range, camera size, projector size" in said
    assert "`fpp system convert" in said
    said = refused("system", "convert", path, out, "--range", 480, 820)
    assert "no camera size, projector size found or given" in said and not out.exists()
    assert fpp("system", "convert", path, out, "--range", 480, 820, *SIZES)[0] == 0
    same(System.load(out))


def test_intrinsics_and_extrinsics_in_two_files_and_in_metres(fpp, refused, tmp_path):
    entries, out = OTHERS["stereo_calib.cpp"], tmp_path / "mine.yml"
    intrinsics = opencv(
        tmp_path / "intrinsics.yml", {k: entries[k] for k in ("M1", "D1", "M2", "D2")}
    )
    extrinsics = opencv(tmp_path / "extrinsics.yml", {"R": R, "T": T / 1000})
    words = ("system", "convert", intrinsics, out, *SIZES)
    assert "no R, T found or given" in refused(*words, "--range", 480, 820)
    words = (*words, "--more", extrinsics)
    assert "give the unit (--unit m)" in refused(*words, "--range", 480, 820)
    assert "--range 0.48 without --unit" in refused(*words, "--range", 0.48, 0.82)
    assert fpp(*words, "--range", 0.48, 0.82, "--unit", "m")[0] == 0
    same(System.load(out))


def test_a_nested_json_of_which_sizes_are_part(fpp, tmp_path):
    nested = {
        "camera": {"K": K[1].tolist(), "dist": D[1], "width": 320, "height": 240},
        "projector": {"K": K[2].ravel().tolist(), "size": [912, 1140]},
        "R": Rotation.from_matrix(R).as_rotvec().tolist(),
        "T": T.tolist(),
    }
    (tmp_path / "a.json").write_text(json.dumps(nested), encoding="utf-8")
    words = ("system", "convert", tmp_path / "a.json", tmp_path / "b.json", "--range", 480, 820)
    assert fpp(*words)[0] == 0
    same(System.load(tmp_path / "b.json"))


def test_ros_writes_yaml_without_a_head(tmp_path):
    text = "image_width: 320\nimage_height: 240\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: "
    text += (
        f"{K[1].ravel().tolist()}\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: {D[1]}\n"
    )
    (tmp_path / "camera_info.yaml").write_text(text, encoding="utf-8")
    matrices = matrices_of(read_entries(tmp_path / "camera_info.yaml"))
    np.testing.assert_allclose(matrices["camera K"], K[1])
    np.testing.assert_allclose(matrices["camera D"].ravel(), D[1])
    assert matrices["camera size"].ravel().tolist() == [320, 240]


def test_a_rotation_of_few_digits_is_made_one_and_others_are_refused():
    rounded = rotation_of(np.round(R, 4))
    np.testing.assert_allclose(rounded @ rounded.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rounded, R, atol=1e-4)
    for wrong in (np.diag([1.0, 1, -1]), 1.1 * np.eye(3), np.zeros((3, 4))):
        with pytest.raises(ValueError, match="rotation"):
            rotation_of(wrong)


def test_a_coefficient_k1_is_no_matrix():
    entries = {"k1": np.array(0.1), "camera_matrix": K[1]}
    assert list(matrices_of(entries)) == ["camera K"]
    with pytest.raises(ValueError, match="no projector K, R, T, camera size, projector size"):
        assemble_system(matrices_of(entries), None, None, 1, 2, 1)


@pytest.mark.parametrize(
    "name, text, said",
    [
        ("a.yml", "%YAML:1.0\n---\nM1: [", "is cut, or no YAML, XML or JSON"),
        ("a.json", "{", "is cut, or no YAML, XML or JSON"),
        ("a.xml", "<?xml version='1.0'?><opencv_storage>", "a.xml"),
        ("a.json", json.dumps({"z_min": 3}), "is a system already"),
    ],
)
def test_files_that_are_none(refused, tmp_path, name, text, said):
    (tmp_path / name).write_text(text, encoding="utf-8")
    words = ("system", "convert", tmp_path / name, tmp_path / "b.json", "--range", 480, 820)
    assert said in refused(*words, *SIZES)
    assert not (tmp_path / "b.json").exists()


def test_options_for_the_files_of_others_need_a_range(refused, tmp_path):
    said = refused("system", "convert", "tiny", tmp_path / "b.json", "--camera", "160x120")
    assert "--camera without --range given" in said
