"""`fpp patterns`: the pictures to project, and the file that tells how to decode them (ch. 12)."""

from typing import Annotated

from fpputil.cli.options import FRINGES, Force, Fringes, Json, Out, Size, option, tell


def patterns(
    out: Out,
    /,
    *,
    projector: Annotated[
        Size | None, option("Pixels (default 912x1140, unless the pitches say otherwise).")
    ] = None,
    fringes: Fringes = FRINGES,
    plain: Annotated[bool, option("White and black, too.", negative="--no-plain")] = True,
    gamma: Annotated[
        float, option("Exponent of the projector, as decode tells it: corrects the pictures.")
    ] = 1.0,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write the pictures to project.

    Writes a PNG for each pattern, numbered in the order in which to show them, patterns.toml, and
    show.html, which shows them full screen in any browser, one pixel on one of the projector, by
    key or clock. Photograph each, keep the photographs under the same names in a folder beside a
    copy of patterns.toml, and `fpp decode` that folder.
    """
    from fpputil.capture.patterns import NAME
    from fpputil.capture.photographs import write_photograph
    from fpputil.files import folder_whole

    files = {"white": "000-white.png", "black": "001-black.png"} if plain else {}
    files |= {"files": "{number:03}-{axis}-{pitch}-{step:02}.png", "gamma": gamma}
    chosen = fringes.patterns(projector, **files)
    shots = chosen.shots()
    with folder_whole(out, "fpp patterns", force) as folder:
        for shot in shots:
            write_photograph(folder / shot.file, chosen.picture(shot))
        chosen.save(folder / NAME)
        page = show_page([shot.file for shot in shots], chosen.projector)
        (folder / "show.html").write_text(page, encoding="utf-8")
    made = {"folder": str(out), "files": [shot.file for shot in shots]}
    width, height = chosen.projector
    pictures = f"{len(shots)} pictures of {width} x {height} and {NAME} in {out}"
    tell(json, made, pictures, f"open {out / 'show.html'} in a browser on the projector")


def show_page(files: list[str], projector: tuple[int, int]) -> str:
    """A page, to lie beside pictures, that shows them one after the other."""
    from jinja2 import Environment, PackageLoader

    templates = Environment(loader=PackageLoader("fpputil", "capture"), autoescape=True)
    width, height = projector
    return templates.get_template("show.html").render(files=files, width=width, height=height)
