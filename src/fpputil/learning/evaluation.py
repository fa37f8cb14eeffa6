"""What a trained network measures: phases, depth, and how far off they are (chapter 8)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

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
from fpputil.learning.metrics import Score, errors
from fpputil.learning.weights import Trained
from fpputil.networks.geometry import Geometry
from fpputil.networks.targets import true_reference
from fpputil.networks.unet import lowered

BATCH = 8


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a network makes of one view.

    Parameters
    ----------
    phi_h : (H, W) float32 array
        Wrapped phase of the high pitch, radians.
    phi_r : (H, W) float32 array or None
        The second wrapped phase, which the method names: of SFNet the refined reference.
    Phi : (H, W) float32 array
        Absolute phase of the high pitch, radians.
    Phi_from_one : (H, W) float32 array
        The same from phi_h alone, without phi_r: the control of one photograph. The network saw
        both, and phi_h has gained by it.
    """

    phi_h: np.ndarray
    phi_r: np.ndarray | None
    Phi: np.ndarray
    Phi_from_one: np.ndarray


@torch.no_grad()
def predict_batch(
    trained: Trained, frames, geometry: Geometry, precision: str = "float32"
) -> list[Prediction]:
    """Phases of photographs, at every pixel. Chapter 8.

    Parameters
    ----------
    trained : Trained
    frames : (B, F, H, W) tensor or array
        Photographs, 0 to 1 by the extremes the network was trained with.
    geometry : Rig
        On the device on which the network is.
    precision : str
        "float32" or "bfloat16".

    Returns
    -------
    list of B `Measured`
    """
    device, method = geometry.Phi_plane.device, trained.method
    frames = torch.as_tensor(frames, dtype=torch.float32).to(device)
    if not torch.isfinite(frames).all():
        raise ValueError("photographs with NaN or infinite pixels given; photograph again")
    outputs = forward(trained.network, method.inputs(frames, geometry), precision)
    phi_h, phi_r = method.phases(outputs)
    maps = (phi_h, phi_r, method.absolute_phase(outputs, geometry), geometry.from_one_phase(phi_h))
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

    Raises
    ------
    ValueError
        If camera or pitches are not those the network was trained for, or it does not say.
    """
    lacking = [k for k in ("pitches", "camera", "extremes") if k not in trained.metadata]
    if lacking:
        raise ValueError(f"these weights do not say for which {lacking[0]} they are")
    data = SynthFringe(
        path,
        split,
        trained.method.photographs,
        augmentation,
        seed,
        extremes=trained.metadata["extremes"],
        texture=texture,
    )
    camera = data.store.system.camera
    found = {"pitches": data.pitches._asdict(), "camera": [camera.height, camera.width]}
    for name, value in found.items():
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
    device: str = "cpu",
    precision: str = "float32",
    progress: bool = False,
) -> Iterator[tuple[dict[str, np.ndarray], Prediction]]:
    """Views of a split, and what the network makes of each.

    Parameters
    ----------
    views : sequence of int, optional
        Positions in the split; by default all.

    Yields
    ------
    item, Measured
        The item of `SynthFringe` as arrays.
    """
    where = device_of(device)
    precision = precision_of(precision, where)
    geometry = Geometry.of(data.store.system, data.pitches, data.extremes).to(where)
    network = trained.network.to(where, memory_format=torch.channels_last)
    if precision != "float32":
        trained = replace(trained, network=lowered(network, PRECISIONS[precision]))
    chosen = data if views is None else Subset(data, views)
    loader = DataLoader(chosen, BATCH, **loader_options(workers))
    bar = tqdm(total=len(chosen), unit="view", disable=not progress, leave=False)
    with closing(loader), bar:
        for batch in loader:
            found = predict_batch(trained, batch["frames"], geometry, precision)
            arrays = {k: v.numpy() for k, v in batch.items()}
            for k, one in enumerate(found):
                yield {name: values[k] for name, values in arrays.items()}, one
            bar.update(len(found))


def evaluate(
    trained: Trained,
    data: SynthFringe,
    each: Callable | None = None,
    truth: SynthFringe | None = None,
    views: Sequence[int] | None = None,
    **how,
) -> tuple[Score, Score]:
    """Errors over a split: of the network, and of its phi_h without its phi_r.

    Parameters
    ----------
    trained : Trained
    data : SynthFringe
        From `open_split`.
    each : callable, optional
        Given every item and what was `Measured` of it.
    truth : SynthFringe, optional
        The same split, whose masks and phases count in place of those of `data`: where only the
        photographs are to differ.
    views : sequence of int, optional
        Positions in the split; by default all.
    **how
        Options of `predictions`.

    Returns
    -------
    Score, Score
        With phi_r; phi_h alone.
    """
    both, alone = Score(), Score()
    system, pitch = data.store.system, data.pitches.high
    views = range(len(data)) if views is None else views
    for at, (item, found) in zip(
        views, predictions(trained, data, views=views, **how), strict=True
    ):
        if truth is not None:
            item = {k: v.numpy() for k, v in truth[at].items()}
        true = item | {"phi_r": true_reference(trained.method, item)}
        model = int(item["model"])
        both.add(model, errors(found.Phi, found.phi_h, found.phi_r, true, system, pitch))
        alone.add(model, errors(found.Phi_from_one, found.phi_h, None, true, system, pitch))
        if each is not None:
            each(item, found)
    return both, alone


def save_points(path: str | Path, item: dict, found: Prediction, data: SynthFringe) -> int:
    """Write the points of one view as PLY, grey as its first photograph; returns their number."""
    Phi = np.where(item["mask"], found.Phi, np.nan)
    points = triangulate(column(Phi, data.pitches.high), data.store.system)
    known = np.isfinite(points).all(axis=-1)
    if not known.any():
        raise ValueError(f"no point found in view {int(item['index'])}; nothing to write")
    grey = (255 * item["frames"][0].clip(0, 1)).astype(np.uint8)
    save_ply(path, points[known], np.repeat(grey[known][:, None], 3, axis=1))
    return int(known.sum())
