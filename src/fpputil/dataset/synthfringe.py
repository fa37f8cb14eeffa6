"""SynthFringe for torch: photographs, and what a network should make of them (chapter 7)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from array_api_compat import array_namespace
from torch.utils.data import Dataset

from fpputil.checks import not_negative, whole
from fpputil.dataset.augmentation import Augmentation, rephotograph, textured
from fpputil.dataset.store import Store, open_store
from fpputil.decoding import phase
from fpputil.decoding.geometric_constraint import minimum_phase, refined_reference, zmin_order
from fpputil.decoding.unwrap import TWO_PI, mf_tpu
from fpputil.optics.fringes import Fringe
from fpputil.optics.system import FREQUENCIES, STEPS, Frame, Pitches
from fpputil.optics.view import View


class SynthFringe(Dataset):
    """One split of a dataset: photographs, targets and truth of each view. Chapter 7.

    Every item is a dict of torch tensors, pixels outside the mask 0, nothing NaN:

    ============ ============ ======= =========================================================
    frames       (F, H, W)    float32 photographs, 0 to 1 by the extremes of the training split
    M, D         (4, H, W)    float32 ``-sin(phi)`` and ``cos(phi)`` of `FREQUENCIES`
    M_r, D_r     (H, W)       float32 the same of the refined reference (paper, Eq. 11)
    phi_r        (H, W)       float32 refined reference, radians
    Phi          (H, W)       float32 absolute phase of the high pitch by MF-TPU, radians
    Phi_true     (H, W)       float32 the same from the geometry, radians
    depth        (H, W)       float32 mm
    modulation   (H, W)       float32 of the high pitch, grey levels
    mask         (H, W)       bool    modulation above the threshold (paper, Eq. 16), and lit
    index, model ()           int64   number of the view and of its model in the dataset
    ============ ============ ======= =========================================================

    The targets are decoded from noiseless 8-bit frames of 15 steps, as in the paper; the
    photographs of a dataset that was imported are the imported ones.

    Parameters
    ----------
    path : str or Path
        A finished dataset.
    split : str
        "training", "validation", "test" or "held-out".
    frames : sequence of (frequency, steps, step)
        What the network is to see; by default step 0 of the high and of the z-min pitch.
    augmentation : Augmentation, optional
        Without it the photographs are what the renderer made of them.
    seed : int
        Of the augmentation: equal seeds, epochs and views give equal items, in any worker.
    threshold : float
        Least modulation, grey levels.
    extremes : (low, high), optional
        Grey levels that become 0 and 1; by default those of this dataset's training split.
    texture : float
        Contrast, 0 to below 1, of dark blotches printed on the surfaces, other ones in every view
        and the same in every epoch. They change targets and mask, too.
    """

    def __init__(
        self,
        path: str | Path,
        split: str,
        frames: Sequence[Frame] = (("high", STEPS, 0), ("zmin", STEPS, 0)),
        augmentation: Augmentation | None = None,
        seed: int = 0,
        threshold: float = phase.THRESHOLD,
        extremes: tuple[float, float] | None = None,
        texture: float = 0.0,
    ):
        self.store: Store = open_store(path)
        self.indices = self.store.indices(split)
        self.pitches = Pitches(**self.store.manifest["pitches"])
        self.extremes = _extremes(self.store, extremes)
        self.frames = tuple(_frame(self.store, *frame) for frame in frames)
        if not self.frames:
            raise ValueError("no frame given; a network needs at least one photograph")
        self.augmentation = augmentation or Augmentation()
        self.threshold = not_negative("threshold", threshold, "grey levels")
        self.seed = whole("seed", seed, 0)
        self.texture = not_negative("texture", texture)
        if self.texture >= 1 or (self.texture and self.store.fringes):
            raise ValueError(
                f"texture {texture} given; a contrast below 1 is needed, and 0 for a dataset of "
                "photographs, which have their own"
            )
        self.Phi_min = minimum_phase(self.store.system, self.pitches.zmin)
        self._epoch = torch.zeros((), dtype=torch.int64).share_memory_()  # workers see it change

    def __len__(self) -> int:
        return len(self.indices)

    def set_epoch(self, epoch: int) -> None:
        """Draw other augmentations than in the epochs before."""
        self._epoch.fill_(whole("epoch", epoch, 0))

    @property
    def epoch(self) -> int:
        """The epoch whose augmentations are drawn."""
        return int(self._epoch)

    def __getitem__(self, number: int) -> dict[str, torch.Tensor]:
        index = int(self.indices[number])
        view = self.store.view(index)
        if self.texture:
            view = textured(view, self.texture, (self.seed, index))
        rng = np.random.default_rng((self.seed, self.epoch, index))
        camera = self.augmentation.draw(rng)
        stored = self.store.array("frames", index) if self.store.fringes else None
        item = self._targets(view, stored, camera["gain"])
        item["frames"] = self._photographs(view, stored, camera)
        item["index"], item["model"] = index, index // self.store.manifest["settings"]["views"]
        return {k: torch.as_tensor(v) for k, v in item.items()}

    def _photographs(self, view: View, stored, camera: dict) -> np.ndarray:
        """What the network sees, (F, H, W) float32."""
        rng = np.random.default_rng(camera["seed"])
        shots = []
        for fringe, step in self.frames:
            options = camera | {"seed": int(rng.integers(2**53))}
            if stored is None:
                shots += list(view.frames(fringe, steps=(step,), **options))
            else:
                shots.append(rephotograph(stored[self.store.position(fringe, step)], **options))
        low, high = self.extremes
        return (np.stack(shots).astype(np.float32) - low) / (high - low)

    def _targets(self, view: View, stored, gain: float) -> dict[str, np.ndarray]:
        """Targets and truth; decoded on the lit pixels alone, which are a fifth of a picture."""
        lit = view.mask
        flat = View(*(a[lit][None] for a in (view.column, view.row, view.shade, view.depth, lit)))
        sums = [self._sums(flat, lit, stored, name, gain) for name in FREQUENCIES]
        phi = np.stack([phase.wrapped_phase(M, D) for M, D, _ in sums])
        modulation = phase.modulation(*sums[0]) * (1 if stored is None else gain)
        Phi_min = self.Phi_min[lit].astype(np.float32)
        values = self.targets(phi, modulation, Phi_min, view.column[lit], view.depth[lit])
        return {k: _image(lit, v) for k, v in values.items()}

    def targets(self, phi, modulation, Phi_min, column, depth) -> dict:
        """Targets and truth by name (..., P) of P lit pixels, NumPy or torch; 0 outside the mask.

        Of the wrapped phases (4, P) of `FREQUENCIES`, the modulation of the high pitch, the minimum
        phase of the z-min pitch, projector column and depth, (P,) each.
        """
        xp, p, (high, mid, zmin, unit) = array_namespace(phi), self.pitches, phi
        _, Phi_t, Phi = mf_tpu([unit, mid, high], p.descending, self.store.system.projector.width)
        phi_r, M_r, D_r = refined_reference(Phi_t, zmin_order(zmin, Phi_min), p.mid, p.zmin)
        mask = phase.mask(modulation, self.threshold)
        values = {
            "M": -xp.sin(phi),
            "D": xp.cos(phi),
            "M_r": M_r,
            "D_r": D_r,
            "phi_r": phi_r,
            "Phi": Phi,
            "Phi_true": TWO_PI * column / p.high,
            "depth": depth,
            "modulation": modulation,
        }
        return {k: xp.where(mask, v, xp.zeros_like(v)) for k, v in values.items()} | {"mask": mask}

    def _sums(self, flat: View, lit, stored, name: str, gain: float):
        """M, D (P,) of the lit pixels at one frequency, and the number of steps behind them."""
        if stored is not None:
            fringe = self.store.fringes[FREQUENCIES.index(name)]
            wanted = [self.store.position(fringe, n) for n in range(fringe.steps)]
            frames = stored[wanted][:, lit]
        else:
            fringe = Fringe(getattr(self.pitches, name), STEPS)
            frames = flat.frames(fringe, gain=gain)[:, 0]
        return *phase.numerator_denominator(frames.astype(np.float32)), fringe.steps


def _frame(store: Store, name: str, steps: int, step: int) -> tuple[Fringe, int]:
    """Fringe and step of a photograph, if the dataset holds or can make it."""
    if name not in FREQUENCIES:
        raise ValueError(f"frequency {name!r} given; the frequencies are {', '.join(FREQUENCIES)}")
    fringe = Fringe(store.manifest["pitches"][name], steps)
    if step not in range(steps):
        raise ValueError(f"step {step} given; a fringe of {steps} steps has steps 0 to {steps - 1}")
    if store.fringes:
        store.position(fringe, step)
    return fringe, step


def _extremes(store: Store, extremes) -> tuple[float, float]:
    extremes = store.manifest["extremes"] if extremes is None else extremes
    if extremes is None:
        raise ValueError(
            f"{store.path} has no training split to take the extremes from; give those of the "
            "dataset that the network was trained on: extremes=(low, high)"
        )
    low, high = (float(level) for level in extremes)
    if not (np.isfinite([low, high]).all() and low < high):
        raise ValueError(f"extremes {low}, {high} given; two grey levels, the lower first")
    return low, high


def _image(lit: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (..., P) of the lit pixels as images (..., H, W), 0 elsewhere."""
    dtype = bool if values.dtype == bool else np.float32
    image = np.zeros((*values.shape[:-1], *lit.shape), dtype)
    image[..., lit] = values
    return image
