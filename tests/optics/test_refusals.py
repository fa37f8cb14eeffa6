"""What cannot be is refused, and the error says what was given and what is needed."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from fpputil.optics import blender, shapes
from fpputil.optics.fringes import Fringe, fringe_set
from fpputil.optics.parts import family_of
from fpputil.optics.pinhole import Pinhole, camera_matrix, looking
from fpputil.optics.raycasting import raycast
from fpputil.optics.system import System, load_system, preset, system_to_dict, table2
from fpputil.optics.view import View

K = camera_matrix(900, 640, 480)
EYE = Pinhole(640, 480, K)
TINY = preset("tiny").system
WALL = shapes.plane(660.0)
FLAT = np.ones((4, 4), np.float32)
VIEW = View(FLAT, FLAT, FLAT, FLAT, FLAT > 0)
LENS = (-0.1, 0.03, 1e-3, -5e-4, 0.0)


def turned(mesh):
    mesh = mesh.copy()
    mesh.invert()
    return mesh


def broken(face=(0, 1, 2), **vertex):
    vertices = np.eye(3)
    vertices[0] = vertex.get("at", vertices[0])
    return trimesh.Trimesh(vertices, [face], process=False)


def with_(pinhole, **change):
    return replace(TINY, **{pinhole: replace(getattr(TINY, pinhole), **change)})


def by_blender(mesh=WALL, system=TINY, fringes=Fringe(24), **look):  # noqa: B008
    return blender.photograph(mesh, system, fringes, **look)


REFUSED = [
    (lambda: Fringe(0), "pitch 0 given; a positive number of projector pixels is needed"),
    (lambda: Fringe("15"), "pitch '15' given"),
    (lambda: Fringe(15, 2), "2 steps given; .* a whole number of 3 steps or more"),
    (lambda: Fringe(15, 5.0), "5.0 steps given"),
    (lambda: Fringe(15, True), "True steps given"),
    (lambda: Fringe(True), "pitch True given"),
    (lambda: Fringe(10**400), "pitch 1000"),
    (
        lambda: Fringe(15, 10**6),
        "steps 1000000 given; more than 16384 are refused, unless",
    ),
    (lambda: Fringe(15, axis="x"), "axis 'x' given; fringes vary along 'column' or 'row'"),
    (lambda: Fringe(15, gamma=np.nan), "gamma nan given"),
    (lambda: Fringe(15, levels=1), "levels 1 given"),
    (lambda: Fringe(15, defocus=-1), "defocus -1 given"),
    (lambda: fringe_set(()), "0 pitches and 0 step counts given"),
    (lambda: fringe_set((15, 114), (3,)), "2 pitches and 1 step counts given"),
    (lambda: VIEW.frames(()), "no fringe given"),
    (lambda: VIEW.frames(Fringe(15), steps=[15]), "steps .15. given; .* steps 0 to 14"),
    (lambda: VIEW.frames(Fringe(15), steps=[1.0]), "steps .1.0. given; .* steps 0 to 14"),
    (lambda: VIEW.frames(Fringe(15), steps=[True]), "steps .True. given"),
    (lambda: VIEW.photograph(256), "light 256.0 to 256.0 given; a projector sends 0 to 255"),
    (lambda: VIEW.plain(noise=-1.0, seed=0), "noise -1.0 given"),
    (lambda: VIEW.plain(noise=1.0), "noise 1.0 without a seed given"),
    (lambda: VIEW.plain(noise=1.0, seed=1.5), "seed 1.5 given"),
    (lambda: VIEW.plain(gain=np.inf), "gain inf given"),
    (lambda: VIEW.plain(gamma=-1), "gamma -1 given"),
    (lambda: VIEW.plain(ambient=-1), "ambient -1 given"),
    (lambda: VIEW.plain(saturation=0), "saturation 0 given"),
    (lambda: replace(VIEW, mask=FLAT < 0), "empty mask given; at least one pixel"),
    (lambda: replace(VIEW, depth=np.ones((4, 5))), r"a view needs one \(H, W\)"),
    (lambda: replace(VIEW, column=FLAT * np.nan), "NaN or infinite values inside the mask"),
    (lambda: replace(EYE, K=np.diag([0.0, 900, 1])), "positive focal lengths"),
    (lambda: replace(EYE, K=np.diag([900.0, 900, 0])), "last row 0 0 1"),
    (lambda: replace(EYE, K=np.full((3, 3), np.nan)), "NaN or infinite camera parameters"),
    (lambda: replace(EYE, K=np.eye(2)), r"K \(2, 2\)"),
    (lambda: replace(EYE, R=2 * np.eye(3)), "a rotation is orthonormal with det"),
    (lambda: replace(EYE, R=np.diag([1.0, 1, -1])), "a rotation is orthonormal with det"),
    (lambda: replace(EYE, t=(1, 2)), r"t \(2,\)"),
    (lambda: replace(EYE, distortion=(0.1, 0.2)), "2 distortion coefficients given"),
    (lambda: replace(EYE, width=640.5), "width 640.5 given"),
    (lambda: replace(EYE, height="480"), "height '480' given"),
    (
        lambda: replace(EYE, width=100_000, height=100_000),
        "100000 x 100000 pixels, in all 10000000000 given; more than 268435456 are refused, unless "
        "the environment variable FPP_MOST_PIXELS says otherwise",
    ),
    (lambda: looking((1, 2, 3), (1, 9, 3), (8, 6), 30.0), "must not be zero or along y"),
    (lambda: looking((0, 0, 0), (0, 0, 1), (8, 6), 180.0), "angle 180.0 given"),
    (lambda: System(EYE, EYE, 500, 400), "measuring range 500 to 400 mm given"),
    (lambda: System(EYE, EYE, np.nan, 500), "measuring range nan to 500 mm given"),
    (lambda: preset("huge"), "preset 'huge' given; the presets are tiny, small, paper, near"),
    (lambda: load_system("none.xml"), "none.xml given; there is no such system file"),
    (lambda: load_system("none"), "preset 'none' given"),
    (lambda: table2().save("system.txt"), "a system file ends in .json, .yml or .yaml"),
    (lambda: shapes.sphere(0), "radius 0 given"),
    (lambda: shapes.sphere(centre=(0, 1)), "three finite coordinates"),
    (lambda: shapes.plane(500, float("nan")), "half_width nan given"),
    (lambda: shapes.step_block([]), "at least one step"),
    (lambda: shapes.step_block([10, -1]), "heights -1.* given"),
    (lambda: shapes.place(broken((0, 1, 9))), "faces on vertices 0 to 9; there are vertices 0 to"),
    (lambda: shapes.place(broken(at=np.nan)), "1 NaN or infinite vertices of 3"),
    (lambda: shapes.place(trimesh.Trimesh()), "has no faces"),
    (lambda: shapes.place(WALL, size=-1), "size -1 given"),
    (lambda: shapes.place(WALL, rotation=(10, 20)), r"shape \(2,\) given"),
    (lambda: shapes.genus(WALL), "every edge to have two faces"),
    (lambda: shapes.part(0, "teapot"), "'teapot' given; the families are bracket"),
    (lambda: family_of(-1), "seed -1 given"),
    (lambda: raycast(trimesh.Trimesh(), TINY), "mesh has no faces"),
    (lambda: raycast(shapes.sphere(10, (5000, 0, 660), 2), TINY), "outside the view of the camera"),
    (lambda: raycast(turned(WALL), TINY), "empty mask"),
    (lambda: raycast(WALL, TINY, albedo=-0.1), "NaN, infinite or negative"),
    (lambda: raycast(WALL, TINY, albedo=np.ones(500)), r"albedo of shape \(500,\) given"),
    (lambda: raycast(WALL, TINY, albedo=lambda p: 0.5), r"albedo of shape \(\) given"),
    (lambda: raycast(WALL, TINY, specular=np.nan), "specular nan given"),
    (lambda: raycast(WALL, TINY, shininess=0), "shininess 0 given"),
    (lambda: raycast(WALL, TINY, white_at=-1.0), "white_at -1.0 given"),
    (lambda: raycast(WALL, TINY, supersample=1.5), "supersample 1.5 given"),
    (lambda: raycast(WALL, TINY, supersample=10**4), "1600000 x 1200000 pixels"),
    (lambda: by_blender(trimesh.Trimesh()), "mesh has no faces"),
    (lambda: by_blender(system=with_("camera", distortion=LENS)), "the ray caster has both"),
    (
        lambda: by_blender(system=with_("camera", K=[[266, 1, 80], [0, 266, 60], [0, 0, 1]])),
        "skew 1",
    ),
    (lambda: by_blender(system=with_("camera", width=3)), "at least 4 x 4"),
    (
        lambda: by_blender(system=with_("projector", distortion=LENS)),
        "Blender's light goes straight",
    ),
    (lambda: by_blender(fringes=Fringe(24, defocus=0.5)), "the ray caster's blurs"),
    (lambda: by_blender(fringes=()), "no fringe given"),
    (lambda: by_blender(samples=0), "samples 0 given"),
    (lambda: by_blender(white_at=0), "white_at 0 given"),
    (lambda: by_blender(albedo=np.ones(5)), r"albedo of shape \(5,\) given"),
    (lambda: by_blender(albedo=lambda p: 0.5), "the ray caster takes functions"),
    (lambda: blender.picture([], (0, 0, 0), (0, 0, 1)), "no body given"),
    (
        lambda: blender.picture([(WALL, "red")], (0, 0, 0), (0, 0, 1), fringe=Fringe(24)),
        "one of projector and fringe given",
    ),
]


@pytest.mark.parametrize("call, words", REFUSED, ids=[words[:24] for _, words in REFUSED])
def test_it_is_refused(call, words):
    with pytest.raises((ValueError, FileNotFoundError), match=words):
        call()


def test_a_limit_is_raised_by_the_environment(monkeypatch):
    monkeypatch.setenv("FPP_MOST_PIXELS", str(10**10))
    assert replace(EYE, width=100_000, height=100_000).width == 100_000
    monkeypatch.setenv("FPP_MOST_PIXELS", "many")
    with pytest.raises(ValueError, match="FPP_MOST_PIXELS 'many' found in the environment"):
        Pinhole(640, 480, K)
    monkeypatch.setenv("FPP_MOST_PIXELS", "100")
    with pytest.raises(ValueError, match="640 x 480 pixels, in all 307200 given; more than 100"):
        Pinhole(640, 480, K)


SYSTEM = system_to_dict(TINY)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"z_min": "480"}, "z_min '480' given; a positive number is needed"),
        ({"z_min": True}, "z_min True given"),
        ({"depth": 1}, "depth is not known"),
        ({"camera": []}, r"camera \[\] given; a table is needed"),
        ({"camera": {**SYSTEM["camera"], "t": ["0", 0, 0]}}, "camera.t.0 '0' given; a finite"),
        ({"camera": {**SYSTEM["camera"], "t": [0, 0]}}, "camera.t .0, 0. given; a list of 3"),
        ({"camera": {**SYSTEM["camera"], "distortion": [None] * 4}}, "camera.distortion.0 None"),
        ({"camera": {**SYSTEM["camera"], "R": None}}, "camera.R None given; a list of 3 is needed"),
        ({"projector": {**SYSTEM["projector"], "width": 10**9}}, "1000000000 x 1140 pixels"),
    ],
)
def test_a_system_file_of_another_structure(change, words, tmp_path):
    path = tmp_path / "system.json"
    path.write_text(json.dumps({**SYSTEM, **change}))
    with pytest.raises(ValueError, match=f"{path} given; .*{words}"):
        load_system(path)


def test_a_system_file_without_an_end(tmp_path):
    (tmp_path / "deep.json").write_text("[" * 100_000)
    with pytest.raises(ValueError, match="deep.json given; .*RecursionError"):
        load_system(tmp_path / "deep.json")
    (tmp_path / "deep.yml").write_text("%YAML:1.0\n---\na: " + "[" * 100_000)
    with pytest.raises(ValueError, match="deep.yml given; .*100017 letters; at most 20000"):
        load_system(tmp_path / "deep.yml")


def test_a_mesh_too_far_away_to_be_read(tmp_path):
    (tmp_path / "far.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1e11 0\n3 0 1 2\n")
    with pytest.raises(ValueError, match=r"far.off has a coordinate of 1e\+11; up to 1e\+10 are"):
        shapes.load_mesh(tmp_path / "far.off")
