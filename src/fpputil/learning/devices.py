"""Where a network runs: device, precision, and how many processes share the work (chapter 8)."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, distributed, nn

from fpputil.checks import whole

PRECISIONS = {"float32": torch.float32, "bfloat16": torch.bfloat16}
CPUINFO = Path("/proc/cpuinfo")


def bfloat16_unit(device: torch.device) -> bool:
    """Whether a device multiplies bfloat16 in hardware: AMX, AVX512-BF16, or a GPU that can."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    known = device.type == "cpu" and CPUINFO.exists()
    words = CPUINFO.read_text(encoding="utf-8").split() if known else ()
    return not {"amx_bf16", "avx512_bf16"}.isdisjoint(words)


def device_of(name: str | None = None) -> torch.device:
    """The device of a name: "cpu", "cuda" (of several processes each takes its own) or "cuda:1".

    By default CUDA if torch can use it.
    """
    name = name or ("cuda" if torch.cuda.is_available() else "cpu")
    kind, _, number = name.partition(":")
    if kind not in ("cpu", "cuda") or not (number.isdecimal() or number == ""):
        raise ValueError(f"device {name!r} given; cpu, cuda, cuda:0, cuda:1 ... are known")
    if kind == "cpu":
        return torch.device("cpu")
    number, count = int(number or os.environ.get("LOCAL_RANK", 0)), torch.cuda.device_count()
    if number >= count:
        raise ValueError(f"device {name!r} given; torch can use {count} such devices here")
    return torch.device("cuda", number)


def use_threads(number: int | None) -> None:
    """Let torch use so many threads of the processor; None leaves all to it."""
    if number is not None:
        torch.set_num_threads(whole("threads", number, 1))


def precision_of(name: str, device: torch.device) -> str:
    """ "float32" or "bfloat16"; "auto" is the latter where the device has a unit for it.

    >>> precision_of("float32", torch.device("cpu"))
    'float32'
    """
    if name == "auto":
        return "bfloat16" if bfloat16_unit(device) else "float32"
    if name not in PRECISIONS:
        raise ValueError(f"precision {name!r} given; float32, bfloat16 or auto is needed")
    return name


def forward(network: nn.Module, frames: Tensor, precision: str) -> Tensor:
    """Outputs of photographs (B, F, H, W), channels last and in `precision` on the way.

    Weights and outputs stay float32; a network that is `lowered` stays in the precision of its
    weights.
    """
    weights = next(network.parameters()).dtype
    frames = frames.to(weights, memory_format=torch.channels_last)
    lower = precision != "float32" and weights is torch.float32
    with torch.autocast(frames.device.type, PRECISIONS[precision], enabled=lower):
        return network(frames)


def hardware(device: torch.device) -> dict:
    """What a result was computed with: processor or GPU, cores, threads, versions."""
    name = platform.processor() or platform.machine()
    if device.type == "cuda":
        name = torch.cuda.get_device_name(device)
    elif CPUINFO.exists():
        lines = CPUINFO.read_text(encoding="utf-8").splitlines()
        models = (line.split(":")[1].strip() for line in lines if line.startswith("model name"))
        name = next(models, name)
    return {
        "device": device.type,
        "name": name,
        "cores": os.cpu_count(),
        "threads": torch.get_num_threads(),
        "torch": torch.__version__,
        "python": platform.python_version(),
    }


@dataclass(frozen=True)
class Processes:
    """The processes that train one network together: which this is, of how many, and its device."""

    rank: int
    size: int
    device: torch.device

    def total(self, *values: float) -> list[float]:
        """Each value added up over all processes, in float64."""
        together = torch.tensor(values, dtype=torch.float64)
        if self.size > 1:
            together = together.to(self.device)
            distributed.all_reduce(together)
        return together.tolist()


@contextmanager
def processes(device: str | None = None) -> Iterator[Processes]:
    """This process among those that `torchrun` started, or alone.

    >>> with processes("cpu") as group:
    ...     group.size, group.total(1.5, 2)
    (1, [1.5, 2.0])
    """
    rank, size = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
    device = device_of(device)
    if device.type == "cuda":
        torch.cuda.set_device(device)
    if size > 1:
        distributed.init_process_group("nccl" if device.type == "cuda" else "gloo")
    try:
        yield Processes(rank, size, device)
    finally:
        if size > 1:
            distributed.destroy_process_group()
