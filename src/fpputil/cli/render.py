"""`fpp render`: photographs of a mesh under the patterns, by the virtual system (chapter 12)."""

from __future__ import annotations

import json as jsons
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

from fpputil.cli.options import Size

SEEDS = 100_000  # between the noise of one scene and that of the next
PIXELS = 40  # of the picture of a board, to a square


def _one(bodies) -> None:
    named = [body.name for body in bodies if body.has_tokens]
    if len(named) != 1:
        raise ValueError(
            f"{' and '.join(named) or 'none'} given; one of {', '.join(b.name for b in bodies)} is "
            "needed"
        )


Body = Parameter(group=Group("Body, one of these", validator=_one))


def render(
    out: Path,
    /,
    *,
    patterns: Path,
    system: str = "paper",
    mesh: Annotated[Path | None, Body] = None,
    part: Annotated[int | None, Body] = None,
    sphere: Annotated[float | None, Body] = None,
    board: Annotated[Size | None, Body] = None,
    size: float | None = None,
    distance: float = 660.0,
    turn: tuple[float, float] = (0.0, 0.0),
    square: float = 25.0,
    kind: str = "chessboard",
    poses: int = 12,
    noise: float = 1.0,
    gain: float = 1.0,
    ambient: float = 0.0,
    gamma: float = 1.0,
    projector_gamma: float = 1.0,
    supersample: int = 2,
    seed: int = 0,
    force: bool = False,
    json: bool = False,
) -> None:
    """Photograph a mesh with the virtual system.

    What a camera would see of the patterns on a body, as PNG files that `fpp decode` reads, with
    system.json and truth.npz (column, row, depth, mask).

    Parameters
    ----------
    out
        New folder.
    patterns
        patterns.toml of `fpp patterns`.
    system
        tiny, small, paper or a system file.
    mesh
        STL, OBJ, PLY, OFF, GLB ...
    part
        A machine part from this seed.
    sphere
        A sphere of this radius, mm.
    board
        A calibration board of so many points across and down, one folder a pose.
    size
        Scale mesh or part to a ball of this diameter, mm.
    distance
        Of its middle from the camera, mm.
    turn
        Degrees about the paper's y and z axes.
    square
        Distance of the board's points, mm.
    kind
        Of the board: chessboard (its points are inner corners), charuco or circles.
    poses
        Of the board.
    noise
        Grey levels.
    gain
        Exposure.
    ambient
        Other light, grey levels.
    gamma
        The camera's response.
    projector_gamma
        The projector's response.
    supersample
        S x S rays a pixel.
    seed
        Of noise and poses.
    force
        Replace OUT.
    json
        Print one JSON object.
    """

    from fpputil.calibration.board import Board
    from fpputil.capture.patterns import Patterns
    from fpputil.capture.virtual import photograph_into, save_truth
    from fpputil.files import folder_whole
    from fpputil.optics import shapes
    from fpputil.optics.parts import part as machine_part
    from fpputil.optics.raycasting import raycast
    from fpputil.optics.shapes import load_mesh
    from fpputil.optics.system import load_system

    shown, rig = Patterns.load(patterns), load_system(system)
    centre = rig.camera.R.T @ ([0, 0, distance] - rig.camera.t)
    camera = {"noise": noise, "gain": gain, "ambient": ambient, "gamma": gamma}

    def bodies():
        """Folder, mesh and albedo of each scene."""
        if board is not None:
            yield from _boards(Board(*board, square, kind), poses, seed, rig)
        elif sphere is not None:
            yield "", shapes.sphere(sphere, centre), 0.9
        else:
            body = machine_part(part) if mesh is None else load_mesh(mesh)
            yield "", shapes.place(body, size, centre, shapes.rotation(*turn)), 0.9

    with folder_whole(out, force) as folder:
        for number, (name, body, albedo) in enumerate(bodies()):
            scene = folder / name
            scene.mkdir(exist_ok=True)
            view = raycast(body, rig, albedo=albedo, supersample=supersample)
            other = seed + SEEDS * number
            photograph_into(scene, view, shown, rig, other, projector_gamma, **camera)
            save_truth(scene / "truth.npz", view)
        rig.save(folder / "system.json")
    scenes = number + 1
    photographs = len(shown.shots()) * scenes
    if json:
        print(jsons.dumps({"folder": str(out), "scenes": scenes, "photographs": photographs}))
    else:
        print(f"{photographs} photographs of {scenes} scene(s) in {out}")


def _boards(board, poses: int, seed: int, rig):
    from fpputil.calibration.placement import PlacedBoard, place_boards
    from fpputil.checks import whole

    picture = board.picture(PIXELS)
    width = picture.shape[1] * board.square / PIXELS
    for k, (R, t) in enumerate(place_boards(whole("poses", poses, 1), seed, rig, board.size)):
        target = PlacedBoard(picture, width, R, t)
        yield f"pose-{k:02}", target.mesh, target.albedo
