"""kill -9 at a hundred moments each: of a dataset, a training, a decode --force and an export.

Each command is run once undisturbed; then again and again from the start, killed a few times on
the way at moments drawn over its length, and left to end: what stands then must be what the
undisturbed run left, byte for byte but for the times it took, and nothing beside it.
``python -m benchmarks.kills`` prints what it found, and exits with 1 if anything differs.
"""

from __future__ import annotations

import argparse
import hashlib
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from safetensors.numpy import load_file

FPP = [sys.executable, "-m", "fpputil.cli"]
EACH = 5  # kills on the way to one end
TIMED = {"log.csv", "curve.png", "summary.json", "report.html", ".fpputil.json"}
TRAIN = (
    *("--epochs", 2, "--training-views", 16, "--validation-views", 4),
    *("--base", 2, "--levels", 3, "--workers", 0, "--threads", 1),
)
GENERATE = ("dataset", "generate", "--models", 10, "--views", 2, "--seed", 1)


def words(root: Path) -> dict[str, list]:
    """Each command, which writes into OUT."""
    data, shots = root / "data", root / "shots"
    return {
        "generate": [*GENERATE, "OUT"],
        "train": ["train", "sfnet", "--data", data, "--out", "OUT", *TRAIN],
        "decode --force": ["decode", shots, "--out", "OUT", "--force", "--no-report"],
        "export": ["dataset", "export", data, "OUT"],
    }


def prepare(root: Path) -> None:
    call([*GENERATE, root / "data"])
    call(["patterns", root / "patterns", "--pitches", 912, 114, 24, "--steps", 4])
    body = ["--part", 3, "--size", 240, "--patterns", root / "patterns" / "patterns.toml"]
    call(["render", root / "shots", "--system", "tiny", *body])


def call(command) -> None:
    subprocess.run([*FPP, *map(str, command)], check=True, capture_output=True)


def content(folder: Path) -> dict[str, str]:
    """Hash of each file, of weights that of the tensors; no hash where a time is written."""
    found = {}
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        name = path.relative_to(folder).as_posix()
        if path.suffix == ".safetensors":
            tensors = load_file(path)
            data = b"".join(k.encode() + tensors[k].tobytes() for k in sorted(tensors))
        else:
            data = b"" if path.name in TIMED else path.read_bytes()
        found[name] = hashlib.sha256(data).hexdigest()
    return found


def killed_often(name: str, command: list, root: Path, kills: int, seed: int) -> tuple[int, list]:
    """How many kills struck, and what differed or lay about at the ends."""
    place, draw = root / "place", random.Random(f"{name} {seed}")
    out = place / "out"

    def run(to_end: bool, length: float = 0.0) -> bool:
        given = [out if word == "OUT" else word for word in command]
        if name == "train" and (out / "config.json").exists():
            given.append("--resume")
        process = subprocess.Popen(
            [*FPP, *map(str, given)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        if not to_end:
            try:
                process.wait(draw.uniform(0.2, 1.0) * length)
            except subprocess.TimeoutExpired:
                process.kill()
        _, said = process.communicate()
        if to_end and process.returncode:
            raise RuntimeError(f"{name} did not end: {said.decode()[-400:]}")
        return process.returncode == -9

    def fresh() -> None:
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()

    fresh()
    start = time.monotonic()
    run(True)
    length, whole = time.monotonic() - start, content(place)
    struck, wrong = 0, []
    while struck < kills:
        fresh()
        if "--force" in command:
            run(True)  # what is to be replaced
        struck += sum(run(False, length) for _ in range(EACH))
        run(True)
        if (now := content(place)) != whole:
            wrong.append(sorted(k for k in {*now, *whole} if now.get(k) != whole.get(k)))
    return struck, wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", help="of generate, train, 'decode --force', export")
    given, failed = parser.parse_args(), False
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        prepare(root)
        for kind, command in words(root).items():
            if given.only and kind not in given.only:
                continue
            struck, wrong = killed_often(kind, command, root, given.kills, given.seed)
            failed |= bool(wrong)
            print(
                f"{kind:15} {struck} kills, {len(wrong)} ends that differ", *wrong[:3], flush=True
            )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
