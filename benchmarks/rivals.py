"""Time and memory of SFNet and its rivals, from photographs of 640 x 480 to absolute phase."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import torch

from benchmarks.timing import median_seconds
from fpputil.experiments.registry import methods
from fpputil.learning.evaluation import predict_batch
from fpputil.learning.weights import Trained
from fpputil.networks.complexity import cost
from fpputil.networks.geometry import Geometry
from fpputil.networks.methods import METHODS
from fpputil.optics.system import preset


def prepared(name: str):
    """What measures one set of photographs by a method, its weights random."""
    p = preset("paper")
    geometry = Geometry.of(p.system, p.pitches)
    method = methods("paper")[name]
    torch.manual_seed(0)
    trained = Trained(method, method.network().to(memory_format=torch.channels_last).eval())
    shots = np.random.default_rng(0).random((1, len(method.photographs), 480, 640), np.float32)
    return trained, lambda: predict_batch(trained, shots, geometry)


def _peak() -> float:
    """Greatest memory of this process so far, MiB."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    (line,) = (line for line in lines if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def bench_rivals(repeats: int = 5) -> dict:
    """Of each method seconds in 32 bit, its ratio to SFNet's, and MiB of memory on top."""
    ways = {name: prepared(name) for name in METHODS}
    seconds = median_seconds(*(act for _, act in ways.values()), repeats=repeats)
    result = {"threads": torch.get_num_threads()}
    for (name, (trained, _)), time in zip(ways.items(), seconds, strict=True):
        run = [sys.executable, "-m", "benchmarks.rivals", name]
        peak = subprocess.run(run, check=True, capture_output=True, text=True).stdout
        result |= {
            f"{name}_seconds": time,
            f"{name}_over_sfnet": time / seconds[0],
            f"{name}_peak_mib": float(peak),
            f"{name}_multiply_adds": cost(trained.network, (480, 640)).multiply_adds,
        }
    return result


if __name__ == "__main__":
    _, act = prepared(sys.argv[1])
    Path("/proc/self/clear_refs").write_bytes(b"5")  # forget the peak, which began as the parent's
    before = _peak()
    act()
    print(_peak() - before)
