"""Read changed files of a kind: ``python tests/mutated_inputs KIND FOLDER [N]``.

Case N of a kind alone leaves its files in FOLDER. The process has a limit of memory and a watchdog.
"""

import json
import random
import shutil
import signal
import sys
import traceback
import warnings
from pathlib import Path

from changes import changed
from kinds import KINDS, Kind, use_capture, use_render

MEMORY, SECONDS = 8 << 30, 20  # that reading a changed file may take


def fault(kind: Kind, folder: Path, file: Path, rng) -> str:
    """What is wrong with how a changed file is answered; "" if nothing is."""
    try:
        kind.use(folder, file, rng)
        left = []
    except (ValueError, OSError, RuntimeError) as error:
        line = str(error)
        if "\n" in line.strip():
            return f"{type(error).__name__} of several lines: {line}"
        names = (file.name, str(folder), *IN_WORDS)
        if not any(name in line for name in names):
            return f"unnamed: {traceback.format_exc()}"
        left = [folder / "out"] if kind.use in WHOLE and (folder / "out").exists() else []
    except BaseException:
        return traceback.format_exc()
    left += folder.rglob("*.part")
    return f"left behind: {left}" if left else ""


IN_WORDS = ("these weights", "the network was trained for", "patterns for a projector of")
"""How a file is named by a function that is given what was in it."""

WHOLE = (use_capture, use_render)
"""What writes the folder `out` whole or not at all."""


def read_changed(name: str, folder: Path, cases: range):
    """Read changed files of a kind; a line of JSON on standard output before each, and after."""
    import resource

    import torch
    from matplotlib.figure import Figure

    warnings.simplefilter("error", RuntimeWarning)  # which would be a second line
    torch.set_num_threads(1)
    Figure.savefig = lambda self, file, **_: file.write(b"no picture")
    kind, sample, out = KINDS[name], folder / "sample", sys.stdout
    if not sample.exists():
        (folder / "made").mkdir(parents=True)
        kind.make(folder / "made")
        (folder / "made").rename(sample)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    for case in cases:
        rng = random.Random(f"{name} {case}")
        copied = Path(shutil.copytree(sample, folder / f"case-{case}"))
        file = rng.choice(sorted(copied.glob(rng.choice(kind.files))))
        file.write_bytes(changed(rng, file))
        print(json.dumps({"case": case, "file": file.name}), file=out, flush=True)
        signal.alarm(SECONDS)
        wrong = fault(kind, copied, file, rng)
        signal.alarm(0)
        if wrong:
            print(json.dumps({"case": case, "fault": wrong}), file=out, flush=True)
        elif len(cases) > 1:
            shutil.rmtree(copied)


if __name__ == "__main__":
    kind, folder, *numbers = sys.argv[1:]
    first, last = [*map(int, numbers), 0][0], KINDS[kind].number
    read_changed(kind, Path(folder), range(first, first + 1 if numbers else last))
