"""`fpp render`: photographs of a mesh under the patterns, by the virtual system (chapter 12)."""

from pathlib import Path
from typing import Annotated

from cyclopts import Group

from fpputil import calibration, capture, optics
from fpputil.cli.options import TARGET, Force, Json, Out, Size, System, Target, option, tell

SEEDS = 100_000  # between the noise of one scene and that of the next
PIXELS = 40  # of the picture of a board, to a square


def _one(bodies) -> None:
    named = [body.name for body in bodies if body.has_tokens]
    if len(named) != 1:
        known = ", ".join(body.name for body in bodies)
        raise ValueError(f"{' and '.join(named) or 'none'} given; one of {known} is needed")


BODY = Group("Body, one of these", validator=_one)


def render(
    out: Out,
    /,
    *,
    patterns: Annotated[Path, option("patterns.toml of `fpp patterns`.")],
    system: System = "paper",
    mesh: Annotated[Path | None, option("STL, OBJ, PLY, OFF, GLB ...", group=BODY)] = None,
    part: Annotated[int | None, option("A machine part from this seed.", group=BODY)] = None,
    sphere: Annotated[float | None, option("A sphere of this radius, mm.", group=BODY)] = None,
    board: Annotated[
        Size | None,
        option("A board of so many points across and down, a folder a pose.", group=BODY),
    ] = None,
    size: Annotated[float | None, option("Scale mesh or part to this diameter, mm.")] = None,
    distance: Annotated[float, option("Of its middle from the camera, mm.")] = 660.0,
    turn: Annotated[
        tuple[float, float] | None, option("Mesh or part about the paper's y and z, degrees.")
    ] = None,
    target: Target = TARGET,
    poses: Annotated[int, option("Of the board.")] = 12,
    noise: Annotated[float, option("Grey levels.")] = 1.0,
    gain: Annotated[float, option("Exposure.")] = 1.0,
    ambient: Annotated[float, option("Other light, grey levels.")] = 0.0,
    gamma: Annotated[float, option("The camera's response.")] = 1.0,
    projector_gamma: Annotated[float, option("The projector's response.")] = 1.0,
    supersample: Annotated[int, option("S x S rays a pixel.")] = 2,
    seed: Annotated[int, option("Of noise and poses.")] = 0,
    force: Force = False,
    json: Json = False,
) -> None:
    """Photograph a mesh with the virtual system.

    What a camera would see of the patterns on a body, as PNG files that `fpp decode` reads, with
    system.json and truth.npz (column, row, depth, mask).
    """
    from fpputil.checks import whole
    from fpputil.files import folder_whole

    if mesh is None and part is None and (size, turn) != (None, None):
        name = "--turn" if size is None else "--size"
        raise ValueError(f"{name} given; it is for --mesh and --part")
    shapes = optics.shapes
    shown, rig = capture.Patterns.load(patterns), optics.load_system(system)
    centre = rig.camera.R.T @ ([0, 0, distance] - rig.camera.t)
    camera = {"noise": noise, "gain": gain, "ambient": ambient, "gamma": gamma}

    def bodies():
        """Folder, mesh and albedo of each scene."""
        if board is not None:
            printed = target.board(*board)
            picture = printed.picture(PIXELS)
            width = picture.shape[1] * target.square / PIXELS
            places = calibration.place_boards(whole("poses", poses, 1), seed, rig, printed.size)
            for k, (R, t) in enumerate(places):
                placed = calibration.PlacedBoard(picture, width, R, t)
                yield f"pose-{k:02}", placed.mesh, placed.albedo
        elif sphere is not None:
            yield "", shapes.sphere(sphere, centre), 0.9
        else:
            body = shapes.part(part) if mesh is None else shapes.load_mesh(mesh)
            yield "", shapes.place(body, size, centre, shapes.rotation(*(turn or (0, 0)))), 0.9

    inputs = [file for file in (patterns, mesh) if file is not None]
    with folder_whole(out, "fpp render", force, inputs) as folder:
        for number, (name, body, albedo) in enumerate(bodies()):
            scene = folder / name
            scene.mkdir(exist_ok=True)
            view = optics.raycast(body, rig, albedo=albedo, supersample=supersample)
            noises = seed + SEEDS * number
            capture.photograph_into(scene, view, shown, rig, noises, projector_gamma, **camera)
            capture.save_truth(scene / "truth.npz", view)
        rig.save(folder / "system.json")
    scenes, photographs = number + 1, len(shown.shots()) * (number + 1)
    counts = {"folder": str(out), "scenes": scenes, "photographs": photographs}
    tell(json, counts, f"{photographs} photographs of {scenes} scene(s) in {out}")
