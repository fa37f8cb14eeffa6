"""Items of `SynthFringe` made where the network runs, a batch at a time (chapter 8).

Decoding 60 photographs for each item keeps several processor cores busy for one fast GPU. Here the
loader reads maps alone, and the device makes photographs and targets of them: the same up to
rounding, but for the noise, which the device draws itself.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from fpputil.dataset.synthfringe import SynthFringe
from fpputil.decoding import phase
from fpputil.decoding.unwrap import TWO_PI
from fpputil.optics.fringes import WHITE
from fpputil.optics.system import FREQUENCIES, STEPS

MAPS = ("column", "shade", "depth", "mask")


class ViewMaps(Dataset):
    """What `synthesise` makes items of: maps (H, W) of each view, and the camera that is drawn.

    ValueError if the dataset holds photographs of its own, or surfaces with texture are asked for.
    """

    def __init__(self, data: SynthFringe):
        if data.store.fringes or data.texture:
            what = "a dataset of photographs" if data.store.fringes else f"texture {data.texture}"
            raise ValueError(f"{what} given; items are made on the device of plain views alone")
        self.data = data

    def __len__(self) -> int:
        return len(self.data)

    def __getitem__(self, number: int) -> dict:
        data, index = self.data, int(self.data.indices[number])
        rng = np.random.default_rng((data.seed, data.epoch, index))
        maps = {name: torch.as_tensor(data.store.array(name, index)) for name in MAPS}
        model = index // data.store.manifest["settings"]["views"]
        return {**maps, **data.augmentation.draw(rng), "index": index, "model": model}


def synthesise(batch: dict[str, Tensor], data: SynthFringe) -> dict[str, Tensor]:
    """A batch of items as `SynthFringe` has them, of a batch of `ViewMaps` on any device.

    Parameters
    ----------
    batch : dict of (B, H, W) and (B,) tensors
        Of a loader of ``ViewMaps(data)``; its seeds decide on the noise.
    data : SynthFringe

    Examples
    --------
    >>> data = SynthFringe("data/tiny", "test")
    >>> one = torch.utils.data.default_collate([ViewMaps(data)[0]])
    >>> item = synthesise(one, data)
    >>> item["frames"].shape, bool((item["Phi"][0] - data[0]["Phi"]).abs().max() < 1e-3)
    (torch.Size([1, 2, 120, 160]), True)
    """
    lit = batch["mask"]
    device = lit.device
    gain, noise, gamma = (batch[k].double()[:, None, None] for k in ("gain", "noise", "gamma"))
    column = batch["column"].double().nan_to_num()
    half = batch["shade"].double() * gain * (WHITE / 2)

    # Photographs, as the network sees them.
    generator = torch.Generator(device).manual_seed(int(batch["seed"].sum() % 2**62))
    low, high = data.extremes
    shots = []
    for fringe, step in data.frames:
        turn = TWO_PI * (column / fringe.pitch + step / fringe.steps)
        light = WHITE * (half * (1 + turn.cos()) / WHITE).clamp(min=0) ** gamma
        drawn = torch.randn(light.shape, generator=generator, device=device)
        shots.append((light + noise * drawn).clamp(0, WHITE).round())
    frames = (torch.stack(shots, 1).float() - low) / (high - low)

    # Targets and truth, of the lit pixels alone: fifteen steps without noise, 8 bit.
    pitches, steps = data.pitches, torch.arange(STEPS, device=device)[:, None]
    column, half = column[lit], half[lit]
    sums = []
    for name in FREQUENCIES:
        turn = TWO_PI * (column / getattr(pitches, name) + steps / STEPS)
        grey = (half * (1 + turn.cos())).clamp(0, WHITE).round().float()
        sums.append(phase.numerator_denominator(grey))
    phi = torch.stack([phase.wrapped_phase(M, D) for M, D in sums])
    modulation = phase.modulation(*sums[0], STEPS)
    Phi_min = torch.as_tensor(data.Phi_min, dtype=torch.float32, device=device)
    Phi_min = Phi_min.expand(lit.shape)[lit]
    targets = data.targets(phi, modulation, Phi_min, column, batch["depth"][lit])
    images = {k: _images(lit, v) for k, v in targets.items()} | {"frames": frames}
    return images | {k: batch[k] for k in ("index", "model")}


def _images(lit: Tensor, values: Tensor) -> Tensor:
    """Values (..., P) of the lit pixels (B, H, W) as images (B, ..., H, W), 0 elsewhere."""
    dtype = torch.bool if values.dtype == torch.bool else torch.float32
    images = torch.zeros((*values.shape[:-1], *lit.shape), dtype=dtype, device=lit.device)
    images[..., lit] = values.to(dtype)
    return images.movedim(-3, 0)
