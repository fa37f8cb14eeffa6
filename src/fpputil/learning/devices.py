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


def bfloat16_unit(device: torch.device) -> bool:
    """Whether a device multiplies bfloat16 in hardware: AMX, AVX512-BF16, or a GPU that can."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    info = Path("/proc/cpuinfo")
    words = set(info.read_text().split()) if device.type == "cpu" and info.exists() else set()
    return bool({"amx_bf16", "avx512_bf16"} & words)


def device_of(name: str) -> torch.device:
    """The device of a name: "cpu", "cuda" (of several processes each takes its own) or "cuda:1".

    Raises
    ------
    ValueError
        If it is none of these, or there is no such GPU.
    """
    kind, _, number = name.partition(":")
    if kind not in ("cpu", "cuda") or not (number.isdecimal() or number == ""):
        raise ValueError(f"device {name!r} given; cpu, cuda, cuda:0, cuda:1 ... are known")
    if kind == "cpu":
        return torch.device("cpu")
    number = int(number or os.environ.get("LOCAL_RANK", 0))
    if number >= torch.cuda.device_count():
        found = torch.cuda.device_count()
        raise ValueError(f"device {name!r} given; torch can use {found} such devices here")
    return torch.device("cuda", number)


def use_threads(number: int | None) -> None:
    """Let torch use so many threads of the processor; None leaves all to it."""
    if number is not None:
        torch.set_num_threads(whole("threads", number, 1))


def precision_of(name: str, device: torch.device) -> str:
    """ "float32" or "bfloat16"; "auto" is the latter where the device has a unit for it."""
    if name == "auto":
        return "bfloat16" if bfloat16_unit(device) else "float32"
    if name not in PRECISIONS:
        raise ValueError(f"precision {name!r} given; float32, bfloat16 or auto is needed")
    return name


def autocast(device: torch.device, precision: str):
    """Context in which convolutions run in `precision`; weights and losses stay float32."""
    lower = precision != "float32"
    return torch.autocast(device.type, PRECISIONS[precision], enabled=lower)


def hardware(device: torch.device) -> dict:
    """What a result was computed with: processor or GPU, cores, threads, versions."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if device.type == "cuda":
        name = torch.cuda.get_device_name(device)
    elif info.exists():
        models = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        name = models[0].split(":")[1].strip() if models else name
    return {
        "device": device.type,
        "name": name,
        "cores": os.cpu_count(),
        "threads": torch.get_num_threads(),
        "torch": torch.__version__,
        "python": platform.python_version(),
    }


def forward(network: nn.Module, frames: Tensor, precision: str) -> Tensor:
    """Outputs of photographs (B, F, H, W), channels last and in `precision` on the way.

    A network that is `lowered` stays in the precision of its weights.
    """
    weights = next(network.parameters()).dtype
    frames = frames.to(weights, memory_format=torch.channels_last)
    with autocast(frames.device, precision if weights is torch.float32 else "float32"):
        return network(frames)


@dataclass(frozen=True)
class Processes:
    """The processes that train one network together.

    Parameters
    ----------
    rank, size : int
        Number of this process, and how many there are.
    device : torch.device
    """

    rank: int
    size: int
    device: torch.device

    def total(self, *values: float) -> list[float]:
        """Each value added up over all processes, in float64."""
        together = torch.tensor(values, dtype=torch.float64)
        return self.add(
            together.to(self.device) if self.device.type == "cuda" else together
        ).tolist()

    def add(self, values: Tensor) -> Tensor:
        """A tensor added up over all processes."""
        if self.size > 1:
            distributed.all_reduce(values)
        return values


@contextmanager
def processes(device: str | None = None) -> Iterator[Processes]:
    """This process among those that `torchrun` started, or alone. Chapter 8.

    Parameters
    ----------
    device : str, optional
        As torch names it; by default a CUDA device for each process where there are any, else
        the CPU.
    """
    rank, size = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
    where = device_of(device or ("cuda" if torch.cuda.is_available() else "cpu"))
    if where.type == "cuda":
        torch.cuda.set_device(where)
    if size > 1:
        distributed.init_process_group("nccl" if where.type == "cuda" else "gloo")
    try:
        yield Processes(rank, size, where)
    finally:
        if size > 1:
            distributed.destroy_process_group()
