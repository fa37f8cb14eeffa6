"""What a trained network measures: phases, depth, and how far off they are (chapter 8)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch.utils.data import DataLoader, Subset
from tqdm.std import tqdm

from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.decoding.pointcloud import save_ply
from fpputil.decoding.triangulation import column, triangulate
from fpputil.learning.devices import PRECISIONS, device_of, forward, precision_of
from fpputil.learning.loaders import closing, loader_options
from fpputil.learning.metrics import Score, errors, limits
from fpputil.learning.weights import Trained, check_rig
from fpputil.networks.geometry import Geometry
from fpputil.networks.targets import true_reference
from fpputil.networks.unet import lowered

BATCH = 8


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a network makes of one view: (H, W) float32 phases, radians.

    Wrapped phase phi_h of the high pitch; phi_r, the second wrapped phase, which the method names,
    of SFNet the refined reference, or None; absolute phase Phi of the high pitch, as the paper of
    the method decodes it; Phi_in_range, the same by `Method.phase_in_range`, told the measuring
    range as every other method is; Phi_from_one, the same from phi_h alone: the control of one
    photograph. The network saw both, and phi_h has gained by it.
    """

    phi_h: np.ndarray
    phi_r: np.ndarray | None
    Phi: np.ndarray
    Phi_in_range: np.ndarray
    Phi_from_one: np.ndarray


class Scores(NamedTuple):
    """Scores of what a network makes of its photographs, by how Phi is decoded.

    As the paper of the method decodes it; told the measuring range; from phi_h alone.
    """

    decoded: Score
    in_range: Score
    alone: Score


def moved(
    trained: Trained, device: str | None, precision: str
) -> tuple[Trained, torch.device, str]:
    """A network ready to measure: device and precision as torch has them."""
    device = device_of(device)
    precision = precision_of(precision, device)
    network = trained.network.to(device, memory_format=torch.channels_last)
    if precision != "float32":
        network = lowered(network, PRECISIONS[precision])
    return replace(trained, network=network), device, precision


@torch.no_grad()
def predict_batch(
    trained: Trained, frames, geometry: Geometry, precision: str = "float32"
) -> list[Prediction]:
    """Phases of photographs, at every pixel. Chapter 8.

    Parameters
    ----------
    frames : (B, F, H, W) tensor or array
        Photographs, 0 to 1 by the extremes the network was trained with.
    geometry : Geometry
        On the device on which the network is.
    precision : str
        "float32" or "bfloat16".
    """
    device, method = geometry.Phi_plane.device, trained.method
    frames = torch.as_tensor(frames, dtype=torch.float32).to(device)
    if not torch.isfinite(frames).all():
        raise ValueError("photographs with NaN or infinite pixels given; photograph again")
    outputs = forward(trained.network, method.inputs(frames, geometry), precision)
    phi_h, phi_r = method.phases(outputs)
    decodings = (method.absolute_phase, method.phase_in_range)
    Phis = [decoded(outputs, geometry) for decoded in decodings]
    maps = (phi_h, phi_r, *Phis, geometry.from_one_phase(phi_h))
    arrays = ([None] * len(frames) if m is None else m.cpu().numpy() for m in maps)
    return [Prediction(*maps) for maps in zip(*arrays, strict=True)]


def open_split(
    trained: Trained,
    path: str | Path,
    split: str,
    augmentation: Augmentation | None = None,
    seed: int = 0,
    texture: float = 0.0,
) -> SynthFringe:
    """A split of a dataset as the network wants its photographs; options as of `SynthFringe`.

    ValueError if camera or pitches are not those the network was trained for, or it does not say.
    """
    check_rig(trained)
    options = {"extremes": trained.metadata["extremes"], "texture": texture}
    data = SynthFringe(path, split, trained.method.photographs, augmentation, seed, **options)
    camera = data.store.system.camera
    made_for = {"pitches": data.pitches._asdict(), "camera": [camera.height, camera.width]}
    for name, value in made_for.items():
        if value != trained.metadata[name]:
            raise ValueError(
                f"the dataset has {name} {value}, the network was trained for "
                f"{trained.metadata[name]}; a network measures only what it was trained for"
            )
    return data


def predictions(
    trained: Trained,
    data: SynthFringe,
    *,
    views: Sequence[int] | None = None,
    workers: int = 0,
    device: str | None = "cpu",
    precision: str = "float32",
    progress: bool = False,
) -> Iterator[tuple[dict[str, np.ndarray], Prediction]]:
    """Items of a split, or of positions in it, as arrays, and what the network makes of each."""
    trained, device, precision = moved(trained, device, precision)
    geometry = Geometry.of(data.store.system, data.pitches, data.extremes).to(device)
    chosen = data if views is None else Subset(data, views)
    loader = DataLoader(chosen, BATCH, **loader_options(workers))
    bar = tqdm(total=len(chosen), unit="view", disable=not progress, leave=False)
    with closing(loader), bar:
        for batch in loader:
            answers = predict_batch(trained, batch["frames"], geometry, precision)
            arrays = {k: v.numpy() for k, v in batch.items()}
            for k, prediction in enumerate(answers):
                yield {name: values[k] for name, values in arrays.items()}, prediction
            bar.update(len(answers))


def evaluate(
    trained: Trained,
    data: SynthFringe,
    each: Callable | None = None,
    truth: SynthFringe | None = None,
    views: Sequence[int] | None = None,
    control: bool = True,
    **how,
) -> Scores:
    """Scores over a split of `open_split`.

    Parameters
    ----------
    each : callable, optional
        Given every item and the `Prediction` of it.
    truth : SynthFringe, optional
        The same split, whose masks and phases count in place of those of `data`: where only the
        photographs are to differ.
    control : bool
        Whether to score phi_h alone, too.
    views, **how
        Options of `predictions`.
    """
    scores = Scores(Score(), Score(), Score())
    system, pitch = data.store.system, data.pitches.high
    views = range(len(data)) if views is None else views
    answers = predictions(trained, data, views=views, **how)
    for view, (item, prediction) in zip(views, answers, strict=True):
        if truth is not None:
            item = {k: v.numpy() for k, v in truth[view].items()}
        true = item | {"phi_r": true_reference(trained.method, item)} | limits(item, system)
        model, phi_h, phi_r = int(item["model"]), prediction.phi_h, prediction.phi_r
        scores.decoded.add(model, errors(prediction.Phi, phi_h, phi_r, true, system, pitch))
        others = [(scores.in_range, prediction.Phi_in_range)]
        if control:
            others.append((scores.alone, prediction.Phi_from_one))
        for score, Phi in others:
            score.add(model, errors(Phi, phi_h, None, true, system, pitch))
        if each is not None:
            each(item, prediction)
    return scores


def save_points(path: str | Path, item: dict, prediction: Prediction, data: SynthFringe) -> int:
    """Write the points of one view as PLY, grey as its first photograph; returns their number."""
    Phi = np.where(item["mask"], prediction.Phi, np.nan)
    points = triangulate(column(Phi, data.pitches.high), data.store.system)
    known = np.isfinite(points).all(axis=-1)
    if not known.any():
        raise ValueError(f"no point found in view {int(item['index'])}; nothing to write")
    grey = (255 * item["frames"][0].clip(0, 1)).astype(np.uint8)
    save_ply(path, points[known], np.repeat(grey[known][:, None], 3, axis=1))
    return int(known.sum())
