"""Give the reader copies of the editions: ``python book/_ext/fpp_copies.py``, as ``make lab`` does.

They lie in ``my-chapters``. A copy in which the reader typed nothing follows its edition; one in
which the reader typed is never written to.
"""

import hashlib
import json
import sys
from pathlib import Path

from fpputil.files import write_whole

ROOT = Path(__file__).parents[2]


def typed(notebook: dict) -> str:
    """Return a hash of what a reader types, which running a notebook leaves alone."""
    cells = [[cell["cell_type"], "".join(cell["source"])] for cell in notebook["cells"]]
    return hashlib.sha256(json.dumps(cells).encode()).hexdigest()


def origin(copy: Path) -> tuple[dict, bool]:
    """Return of which edition a copy was made, and whether nobody has typed in it since."""
    try:
        own = json.loads(copy.read_text(encoding="utf-8"))
        given = own["metadata"]["fpp_edition"]
        return given, given["typed"] == typed(own)
    except (ValueError, KeyError, TypeError):  # not made of an edition
        return {}, False


def trust(text: str) -> None:
    """Have JupyterLab run the figures to play with at once."""
    import nbformat
    from nbformat.sign import NotebookNotary

    NotebookNotary().sign(nbformat.reads(text, as_version=4))


def refresh(editions: Path, copies: Path) -> list[str]:
    """Bring the copies up to date.

    Parameters
    ----------
    editions, copies : Path
        Folders; that of the copies is made if need be.

    Returns
    -------
    list of str
        Names of copies that the reader changed and whose edition is another one by now.
    """
    copies.mkdir(exist_ok=True)
    kept = []
    for file in sorted(editions.glob("*.ipynb")):
        text, copy = file.read_text(encoding="utf-8"), copies / file.name
        if copy.exists():
            given, untouched = origin(copy)
            if given == json.loads(text)["metadata"]["fpp_edition"]:
                continue
            if not untouched:
                kept.append(file.name)
                continue
        write_whole(copy, text.encode())
        trust(text)
    return kept


def main(editions: Path = ROOT / "_build/editions", copies: Path = ROOT / "my-chapters") -> None:
    try:
        for name in refresh(editions, copies):
            print(f"kept {copies}/{name}, which you changed; the new one is {editions}/{name}")
    except OSError as error:
        why = f"{error.strerror}, {error.filename}" if error.filename else error.strerror
        sys.exit(
            f"the chapters cannot be copied to {copies} ({why}). Where you may write, type "
            f"cp -r {ROOT} . and make lab in the copy."
        )


if __name__ == "__main__":
    main()
