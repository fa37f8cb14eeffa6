"""One view of an object: where each camera pixel is lit from, and its photographs (chapter 2)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fpputil.checks import not_negative, positive, seeded
from fpputil.optics.fringes import WHITE, Fringe

CACHED = 2**17  # pixels of several steps, if they are few, are worked on together


@dataclass(frozen=True, eq=False)
class View:
    """What the camera sees of a scene, before any pattern is chosen. Chapter 2.

    Parameters
    ----------
    column, row : (H, W) float32 array
        Projector pixel that lights the camera pixel; NaN outside the mask.
    shade : (H, W) float32 array
        Share of the projected intensity that returns to the pixel; 0 outside the mask.
    depth : (H, W) float32 array
        Distance along the camera's axis, mm; NaN outside the mask.
    mask : (H, W) bool array
        True where a surface is seen that the projector lights.
    fine : View, optional
        The same view on an s times finer grid; frames are then means over s x s samples.
    """

    column: np.ndarray
    row: np.ndarray
    shade: np.ndarray
    depth: np.ndarray
    mask: np.ndarray
    fine: View | None = None

    def __post_init__(self):
        object.__setattr__(self, "mask", np.asarray(self.mask, bool))
        shapes = {np.shape(a) for a in (self.column, self.row, self.shade, self.depth, self.mask)}
        if len(shapes) != 1 or len(next(iter(shapes))) != 2:
            raise ValueError(f"arrays of shapes {sorted(shapes)} given; a view needs one (H, W)")
        if not np.any(self.mask):
            raise ValueError(
                "view with an empty mask given; at least one pixel must be seen and lit "
                "(is the object in both images, and does it face the projector?)"
            )
        values = (self.column, self.row, self.shade, self.depth)
        if not all(np.isfinite(np.asarray(a)[self.mask]).all() for a in values):
            raise ValueError("NaN or infinite values inside the mask given; all must be finite")

    def frames(
        self,
        fringes: Fringe | Iterable[Fringe],
        noise: float = 0.0,
        seed: int | None = None,
        *,
        steps: Sequence[int] | None = None,
        gain: float = 1.0,
        ambient: float = 0.0,
        gamma: float = 1.0,
        saturation: float | None = None,
        quantise: bool = True,
    ) -> np.ndarray:
        """Photograph the view under one fringe or a set of them.

        Parameters
        ----------
        fringes : Fringe or sequence of Fringe
            The projected patterns, in the order of the frames.
        noise : float
            Standard deviation of the Gaussian read noise, grey levels.
        seed : int, optional
            Seed of the noise; needed if ``noise > 0``.
        steps : sequence of int, optional
            Which steps of each fringe to photograph; all by default.
        gain : float
            Exposure: factor on the light.
        ambient : float
            Light, in grey levels, that does not come from the projector.
        gamma : float
            Camera response: the normalised intensity is raised to this power.
        saturation : float, optional
            Grey level above which the sensor clips. Quantised frames clip at 255 at the latest;
            float frames do not clip unless it is given.
        quantise : bool
            True for uint8, False for float64.

        Returns
        -------
        (N, H, W) array
            uint8 or float64; N is the number of steps of all fringes together.

        Raises
        ------
        ValueError
            If a parameter is out of range, or noise is asked for without a seed.
        """
        fringes = (fringes,) if isinstance(fringes, Fringe) else tuple(fringes)
        _check_camera(noise, seed, gain, ambient, gamma, saturation)
        if not fringes:
            raise ValueError("no fringe given; a photograph needs at least one pattern")
        which = [_which(f, steps) for f in fringes]
        number = sum(len(w) for w in which)
        out = np.empty((number, *self.mask.shape), np.uint8 if quantise else np.float64)
        dtype = np.float32 if quantise else np.float64
        rng = seeded(seed) if noise else None
        top = np.inf if saturation is None else saturation
        top = min(top, WHITE) if quantise else top
        n = 0
        for fringe, chosen in zip(fringes, which, strict=True):
            for light in self._lights(fringe, chosen, dtype):
                if gain != 1:
                    light *= dtype(gain)
                if ambient:
                    light += dtype(ambient)
                if gamma != 1:
                    np.maximum(light, 0, out=light)  # rounding may leave black below zero
                    light = dtype(WHITE) * (light / dtype(WHITE)) ** dtype(gamma)
                if noise:
                    light += dtype(noise) * rng.standard_normal(light.shape, dtype)
                if noise or np.isfinite(top):
                    lowest = 0 if quantise else -np.inf
                    np.clip(light, lowest, top, out=light)
                if quantise:
                    np.rint(light, out=light)
                out[n : n + len(light)] = light
                n += len(light)
        return out

    def plain(self, **camera) -> np.ndarray:
        """The view in plain white light, (H, W); keyword arguments as for `frames`."""
        white = Fringe(1e12, 3)  # a period so long that step 0 is white over the whole field
        return self.frames(white, **camera)[0]

    def _lights(self, fringe: Fringe, which: Sequence[int], dtype) -> Iterator[np.ndarray]:
        """Light of the chosen steps at each pixel, before the camera, some (S, H, W) at a time."""
        if self.fine is not None:
            for light in self.fine._lights(fringe, which, dtype):
                yield _block_mean(light, (len(light), *self.mask.shape))
            return
        coordinate = self.column if fringe.axis == "column" else self.row
        shade = self.shade.astype(dtype)
        coordinate = np.where(self.mask, coordinate, 0).astype(np.float64)
        if not fringe.ideal:
            for n in which:
                yield (shade * fringe.intensity(coordinate, n)).astype(dtype)[None]
            return
        phase = np.remainder(fringe.phase(coordinate), 2 * np.pi).astype(dtype)
        half = shade * dtype(WHITE / 2)
        cosine, sine = half * np.cos(phase), half * np.sin(phase)
        at_once = max(1, CACHED // half.size)
        for first in range(0, len(which), at_once):
            delta = fringe.shifts[list(which[first : first + at_once])]
            light = np.multiply.outer(np.cos(delta).astype(dtype), cosine)
            light += half
            light -= np.multiply.outer(np.sin(delta).astype(dtype), sine)
            yield light


def _which(fringe: Fringe, steps: Sequence[int] | None) -> Sequence[int]:
    if steps is None:
        return range(fringe.steps)
    if not len(steps) or not all(n in range(fringe.steps) for n in steps):
        raise ValueError(
            f"steps {list(steps)} given; a fringe of {fringe.steps} steps has steps 0 to "
            f"{fringe.steps - 1}, and a photograph needs one"
        )
    return steps


def _block_mean(images: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    s, h, w = shape
    fine = images.shape
    return images.reshape(s, h, fine[1] // h, w, fine[2] // w).mean(axis=(2, 4))


def _check_camera(noise, seed, gain, ambient, gamma, saturation):
    not_negative("noise", noise, "grey levels")
    if noise and seed is None:
        raise ValueError(f"noise {noise} without a seed given; random draws need a seed")
    positive("gain", gain)
    positive("gamma", gamma)
    not_negative("ambient", ambient, "grey levels")
    if saturation is not None:
        positive("saturation", saturation, "grey levels")
