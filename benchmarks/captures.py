"""A folder of photographs decoded by `fpp decode`: what reading the files takes of it."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from benchmarks.timing import median_seconds
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.cli import main
from fpputil.optics.fringes import fringe_set

SIZE = (1200, 1920)


def bench_captures(repeats: int = 3) -> dict:
    """Sixty PNG files of 1920 x 1200: reading alone, decoding as well, and the whole command."""
    patterns = Patterns((1920, 1200), fringe_set((1920, 240, 48, 24), 15))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "shots"
        folder.mkdir()
        _write(folder, patterns)
        capture = open_capture(folder)

        def read():
            for k in range(len(patterns.fringes)):
                capture.frames(k)

        reading, decoding = median_seconds(read, lambda: measure(capture), repeats=repeats)
        start = time.perf_counter()
        main(["decode", str(folder), "--out", str(Path(name) / "out"), "--json"])
        command = time.perf_counter() - start
    return {
        "reading_seconds": reading,
        "reading_and_decoding_seconds": decoding,
        "decoding_share": 1 - reading / decoding,
        "command_seconds": command,
        "decoding_share_of_command": (decoding - reading) / command,
    }


def _write(folder: Path, patterns: Patterns) -> None:
    """Photographs of a plane with a soft shade and noise, as a camera gives them."""
    rng = np.random.default_rng(0)
    v, u = np.indices(SIZE, dtype=np.float32)
    shade = 0.35 + 0.3 * np.cos(u / 500) * np.cos(v / 400)
    for shot in patterns.shots():
        fringe = patterns.fringes[shot.fringe]
        phase = fringe.phase(u) + fringe.shifts[shot.step]
        light = shade * 127.5 * (1 + np.cos(phase))
        light += rng.standard_normal(SIZE, np.float32)
        cv2.imwrite(str(folder / shot.file), np.clip(np.rint(light), 0, 255).astype(np.uint8))
    patterns.save(folder / "patterns.toml")
