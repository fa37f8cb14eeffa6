"""`fpp render`: photographs of a mesh under the patterns, by the virtual system (chapter 12)."""

from __future__ import annotations

import json
from pathlib import Path

from fpputil.cli.patterns import size

SEEDS = 100_000  # between the noise of one scene and that of the next
PIXELS = 40  # of the picture of a board, to a square


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    render = commands.add_parser(
        "render",
        help="photograph a mesh with the virtual system",
        description="What a camera would see of the patterns on a body, as PNG files that `fpp "
        "decode` reads, with system.json and truth.npz (column, row, depth, mask).",
    )
    render.add_argument("out", metavar="OUT", type=Path, help="new folder")
    render.add_argument("--patterns", type=Path, required=True, metavar="FILE",
                        help="patterns.toml of `fpp patterns`")  # fmt: skip
    render.add_argument("--system", default="paper", metavar="S",
                        help="tiny, small, paper (default) or a system file")  # fmt: skip
    body = render.add_mutually_exclusive_group(required=True)
    body.add_argument("--mesh", type=Path, metavar="FILE", help="STL, OBJ, PLY, OFF, GLB ...")
    body.add_argument("--part", type=int, metavar="SEED", help="a machine part from a seed")
    body.add_argument("--sphere", type=float, metavar="R", help="a sphere of radius R mm")
    body.add_argument("--board", type=size, metavar="CxR",
                      help="a calibration board of C x R points, one folder a pose")  # fmt: skip
    render.add_argument("--size", type=float, metavar="MM",
                        help="scale mesh or part to a ball of this diameter")  # fmt: skip
    render.add_argument("--distance", type=float, default=660.0, metavar="MM",
                        help="of its middle from the camera (default 660)")  # fmt: skip
    render.add_argument("--turn", type=float, nargs=2, default=(0.0, 0.0), metavar=("Y", "Z"),
                        help="degrees about the paper's y and z axes")  # fmt: skip
    add_board(render)
    render.add_argument("--poses", type=int, default=12, help="of the board (default 12)")
    _camera(render)
    render.add_argument("--force", action="store_true", help="replace OUT")
    render.add_argument("--json", action="store_true", help="print one JSON object")
    render.set_defaults(run=_render, go_on="nothing was written")


def add_board(parser) -> None:
    """Add the options that tell what a board is like."""
    parser.add_argument("--square", type=float, default=25.0, metavar="MM",
                        help="distance of the board's points (default 25)")  # fmt: skip
    parser.add_argument("--kind", default="chessboard",
                        help="chessboard (default; inner corners), charuco or circles")  # fmt: skip


def _camera(render) -> None:
    render.add_argument("--noise", type=float, default=1.0, help="grey levels (default 1)")
    render.add_argument("--gain", type=float, default=1.0, help="exposure (default 1)")
    render.add_argument("--ambient", type=float, default=0.0, help="other light, grey levels")
    render.add_argument("--gamma", type=float, default=1.0, help="the camera's response")
    render.add_argument("--projector-gamma", type=float, default=1.0, metavar="G",
                        help="the projector's response")  # fmt: skip
    render.add_argument("--supersample", type=int, default=2, metavar="S",
                        help="S x S rays a pixel (default 2)")  # fmt: skip
    render.add_argument("--seed", type=int, default=0, help="of noise and poses (default 0)")


def _render(options) -> None:
    from fpputil.capture.patterns import Patterns
    from fpputil.files import folder_whole
    from fpputil.optics.system import load_system

    patterns = Patterns.load(options.patterns)
    system = load_system(options.system)
    with folder_whole(options.out, options.force) as folder:
        scenes = 0
        for number, (name, mesh, albedo) in enumerate(_bodies(options, system)):
            if name:
                (folder / name).mkdir()
            _photograph(options, number, folder / name, patterns, system, mesh, albedo)
            scenes += 1
        system.save(folder / "system.json")
    shots = len(patterns.shots())
    found = {"folder": str(options.out), "scenes": scenes, "photographs": shots * scenes}
    if options.json:
        print(json.dumps(found))
    else:
        print(f"{found['photographs']} photographs of {scenes} scene(s) in {options.out}")


def _bodies(options, system):
    """Name of the folder, mesh and albedo of each scene."""
    import numpy as np

    from fpputil.optics import shapes
    from fpputil.optics.parts import part
    from fpputil.optics.shapes import load_mesh

    centre = np.array([0, 0, options.distance]) - system.camera.t
    turn = shapes.rotation(*options.turn)
    if options.sphere is not None:
        yield "", shapes.sphere(options.sphere, centre), 0.9
    elif options.board is None:
        mesh = part(options.part) if options.mesh is None else load_mesh(options.mesh)
        yield "", shapes.place(mesh, options.size, centre, turn), 0.9
    else:
        yield from _boards(options, system)


def _boards(options, system):
    from fpputil.calibration.board import Board
    from fpputil.calibration.placement import PlacedBoard, place_boards
    from fpputil.checks import whole

    board = Board(*options.board, options.square, options.kind)
    picture = board.picture(PIXELS)
    width = picture.shape[1] * board.square / PIXELS
    poses = place_boards(whole("poses", options.poses, 1), options.seed, system, board.size)
    for k, (R, t) in enumerate(poses):
        target = PlacedBoard(picture, width, R, t)
        yield f"pose-{k:02}", target.mesh, target.albedo


def _photograph(options, number, folder, patterns, system, mesh, albedo) -> None:
    from fpputil.capture.virtual import photograph_into, save_truth
    from fpputil.optics.raycasting import raycast

    view = raycast(mesh, system, albedo=albedo, supersample=options.supersample)
    camera = {k: getattr(options, k) for k in ("noise", "gain", "ambient", "gamma")}
    response, seed = options.projector_gamma, options.seed + SEEDS * number
    photograph_into(folder, view, patterns, system, seed, response, **camera)
    save_truth(folder / "truth.npz", view)
