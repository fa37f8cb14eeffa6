"""A folder of photographs decoded by `fpp decode`: what reading files and bending rays take."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks.timing import median_seconds
from fpputil.capture.measurement import measure
from fpputil.capture.patterns import Patterns
from fpputil.capture.photographs import open_capture
from fpputil.capture.virtual import photograph_into
from fpputil.cli import main
from fpputil.optics.fringes import fringe_set
from fpputil.optics.pinhole import Pinhole, camera_matrix
from fpputil.optics.raycasting import raycast
from fpputil.optics.shapes import plane
from fpputil.optics.system import preset

SIZE = (1200, 1920)
USE = """
import sys, time
from fpputil.cli import main
assert main(sys.argv[1:]) == 0
lines = open("/proc/self/status").read().splitlines()
peak = next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))
print([time.process_time(), peak])
"""  # seconds of CPU and peak memory, MB, of a command


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


def bench_lens() -> dict:
    """Six photographs of 1920 x 1200 to points, with lenses that distort and without: the command.

    CPU and memory of the whole process; the ratios are what lenses cost.
    """
    camera = Pinhole(*SIZE[::-1], camera_matrix(3200, *SIZE[::-1]))
    ideal = replace(preset("paper").system, camera=camera)
    bent = replace(
        ideal,
        camera=replace(camera, distortion=(-0.12, 0.06, 8e-4, -6e-4)),
        projector=replace(ideal.projector, distortion=(0.03, -0.02, -4e-4, 5e-4)),
    )
    used = {}
    with tempfile.TemporaryDirectory() as room:
        for name, system in (("ideal", ideal), ("bent", bent)):
            view = raycast(plane(650.0), system)
            patterns = Patterns((912, 1140), fringe_set((912, 48), 3))
            photograph_into(f"{room}/{name}", view, patterns, system, noise=1.0)
            system.save(f"{room}/{name}.json")
            words = ["decode", f"{room}/{name}", "--system", f"{room}/{name}.json", "--json"]
            command = [sys.executable, "-c", USE, *words]
            run = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
            used[name] = json.loads(run.stdout.splitlines()[-1])
    (seconds, memory), (seconds_bent, memory_bent) = used["ideal"], used["bent"]
    return {
        "cpu_seconds": seconds,
        "cpu_seconds_with_lenses": seconds_bent,
        "cpu_ratio": seconds_bent / seconds,
        "peak_MB": memory,
        "peak_MB_with_lenses": memory_bent,
        "memory_ratio": memory_bent / memory,
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
