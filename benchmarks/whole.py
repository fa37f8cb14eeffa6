"""One whole dataset, watched: time, bytes, memory of the workers, and the rate on the way.

``python -m benchmarks.whole OUT`` makes the paper's 18,000 views, 500 models in 36 poses, and
writes what it saw to data/results/synthfringe-paper.json. Chapter 7 draws it.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

import psutil

from fpputil.files import write_whole

RESULTS = Path(__file__).parents[1] / "data" / "results"


def processor() -> str:
    """What the machine calls its processor."""
    file = Path("/proc/cpuinfo")
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    found = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return found[0] if found else platform.processor()


def watch(run: subprocess.Popen, out: Path, views: int) -> tuple[list, float]:
    """Finished views against seconds, and the largest memory of one process, MB."""
    start, curve, most = time.perf_counter(), [], 0.0
    while run.poll() is None:
        for process in [psutil.Process(run.pid), *psutil.Process(run.pid).children(recursive=True)]:
            try:
                most = max(most, process.memory_info().rss / 1e6)
            except psutil.NoSuchProcess:
                pass
        done = views * len(list(out.glob("records/*.json")))
        if done and (not curve or done >= curve[-1][1] + 10 * views):
            curve.append((round(time.perf_counter() - start, 1), done))
        time.sleep(0.5)
    return curve, most


def main() -> None:
    """Make the dataset and write down what it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--preset", default="paper")
    parser.add_argument("--models", type=int, default=500)
    parser.add_argument("--held-out", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    said = ["--preset", options.preset, "--models", str(options.models)]
    said += ["--held-out", str(options.held_out), "--workers", str(options.workers)]
    command = [sys.executable, "-m", "fpputil.cli", "dataset", "generate", str(options.out), *said]
    start = time.perf_counter()
    run = subprocess.Popen(command)
    curve, memory = watch(run, options.out, 36)
    seconds = time.perf_counter() - start
    if run.returncode:
        sys.exit(run.returncode)
    manifest = json.loads((options.out / "manifest.json").read_bytes())
    files = [f for f in options.out.rglob("*") if f.is_file()]
    result = {
        "command": " ".join(["fpp dataset generate", *said, "OUT"]),
        "views": 36 * (options.models + options.held_out),
        "seconds": round(seconds),
        "bytes": sum(f.stat().st_size for f in files),
        "largest process, MB": round(memory),
        "seconds, views": curve,
        "processor": processor(),
        "cores": os.cpu_count(),
        "versions": manifest["versions"],
        "content": manifest["content"],
    }
    RESULTS.mkdir(parents=True, exist_ok=True)
    target = RESULTS / f"synthfringe-{options.preset}.json"
    write_whole(target, (json.dumps(result, indent=1) + "\n").encode())
    print(f"{result['views']} views in {seconds:.0f} s, {result['bytes'] / 1e9:.2f} GB; {target}")


if __name__ == "__main__":
    main()
