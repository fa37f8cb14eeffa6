"""One view of an object: where each camera pixel is lit from, and its photographs (chapter 2)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from fpputil.checks import not_negative, positive, seeded
from fpputil.optics.fringes import WHITE, Fringe
from fpputil.optics.graycode import GrayCode

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
        values = [np.asarray(a) for a in (self.column, self.row, self.shade, self.depth)]
        shapes = {a.shape for a in (*values, self.mask)}
        if len(shapes) != 1 or self.mask.ndim != 2:
            raise ValueError(f"arrays of shapes {sorted(shapes)} given; a view needs one (H, W)")
        if not np.any(self.mask):
            raise ValueError(
                "view with an empty mask given; at least one pixel must be seen and lit "
                "(is the object in both images, and does it face the projector?)"
            )
        if not all(np.isfinite(a[self.mask]).all() for a in values):
            raise ValueError("NaN or infinite values inside the mask given; all must be finite")

    def frames(
        self,
        fringes: Fringe | GrayCode | Iterable[Fringe | GrayCode],
        noise: float = 0.0,
        seed: int | None = None,
        *,
        steps: Sequence[int] | None = None,
        **camera,
    ) -> np.ndarray:
        """Photograph the view under one fringe or a set of them.

        The frames, (N, H, W), are in the order of the fringes; of each, all `steps` or those named.
        Other arguments as of `photograph`.

        >>> flat = np.ones((2, 3))
        >>> view = View(column=0 * flat, row=flat, shade=flat, depth=600 * flat, mask=flat > 0)
        >>> view.frames(Fringe(912, steps=4))[:, 0, 0].tolist()
        [255, 128, 0, 128]
        """
        fringes = (fringes,) if isinstance(fringes, Fringe | GrayCode) else tuple(fringes)
        if not fringes:
            raise ValueError("no fringe given; a photograph needs at least one pattern")
        for fringe in fringes if steps is not None else ():
            known = (isinstance(n, Integral) and not isinstance(n, bool) for n in steps)
            if not len(steps) or not all(known) or not set(steps) <= set(range(fringe.steps)):
                raise ValueError(
                    f"steps {list(steps)} given; a fringe of {fringe.steps} steps has steps 0 to "
                    f"{fringe.steps - 1}, and a photograph needs one"
                )
        patterns = [(f, range(f.steps) if steps is None else steps) for f in fringes]
        return self.photograph(patterns, noise, seed, **camera)

    def plain(self, **camera) -> np.ndarray:
        """The view in plain white light, (H, W); arguments as for `photograph`."""
        return self.photograph(WHITE, **camera)[0]

    def dark(self, **camera) -> np.ndarray:
        """The view without the projector's light, (H, W); arguments as for `photograph`."""
        return self.photograph(0.0, **camera)[0]

    def photograph(
        self,
        light: float | np.ndarray | list[tuple[Fringe, Sequence[int]]],
        noise: float = 0.0,
        seed: int | None = None,
        *,
        gain: float = 1.0,
        ambient: float = 0.0,
        gamma: float = 1.0,
        saturation: float | None = None,
        quantise: bool = True,
    ) -> np.ndarray:
        """Photograph the view under any light of the projector.

        Parameters
        ----------
        light : float, (H, W) array, or list of (Fringe, steps)
            0 to 255: one grey level that the projector shows everywhere, or the light that it
            sends to each pixel (of `fine`, if there is one); or steps of fringes.
        noise : float
            Standard deviation of the Gaussian read noise, grey levels.
        seed : int, optional
            Seed of the noise; needed if ``noise > 0``.
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
            N is 1, or the number of steps of all fringes together.

        Examples
        --------
        >>> flat = np.ones((2, 3))
        >>> view = View(column=0 * flat, row=flat, shade=flat / 2, depth=flat, mask=flat > 0)
        >>> view.photograph(100.0, ambient=20)[0, 0].tolist()
        [70, 70, 70]
        """
        not_negative("noise", noise, "grey levels")
        if noise and seed is None:
            raise ValueError(f"noise {noise} without a seed given; random draws need a seed")
        positive("gain", gain)
        positive("gamma", gamma)
        not_negative("ambient", ambient, "grey levels")
        if saturation is not None:
            positive("saturation", saturation, "grey levels")
        number = sum(len(steps) for _, steps in light) if isinstance(light, list) else 1
        if not isinstance(light, list):
            light = np.asarray(light, np.float64)
            if not ((light >= 0) & (light <= WHITE)).all():
                raise ValueError(
                    f"light {light.min()} to {light.max()} given; a projector sends 0 to 255"
                )
        dtype = np.float32 if quantise else np.float64
        out = np.empty((number, *self.mask.shape), np.uint8 if quantise else dtype)
        rng = seeded(seed) if noise else None
        top = min(saturation or np.inf, WHITE if quantise else np.inf)
        n = 0
        for block in self._returned(light, dtype):
            if gain != 1:
                block *= dtype(gain)
            if ambient:
                block += dtype(ambient)
            if gamma != 1:
                np.maximum(block, 0, out=block)  # rounding may leave black below zero
                block = dtype(WHITE) * (block / dtype(WHITE)) ** dtype(gamma)
            if noise:
                block += dtype(noise) * rng.standard_normal(block.shape, dtype)
            if noise or np.isfinite(top):
                np.clip(block, 0 if quantise else -np.inf, top, out=block)
            if quantise:
                np.rint(block, out=block)
            out[n : n + len(block)] = block
            n += len(block)
        return out

    def _returned(self, light, dtype) -> Iterator[np.ndarray]:
        """Light that comes back to each pixel, before the camera, some (S, H, W) at a time."""
        if self.fine is not None:
            (h, w), (fine_h, fine_w) = self.mask.shape, self.fine.mask.shape
            for block in self.fine._returned(light, dtype):
                samples = block.reshape(len(block), h, fine_h // h, w, fine_w // w)
                yield samples.mean(axis=(2, 4))
            return
        shade = self.shade.astype(dtype)
        if not isinstance(light, list):
            yield (shade * light.astype(dtype))[None]
            return
        for fringe, steps in light:
            coordinate = self.column if fringe.axis == "column" else self.row
            coordinate = np.where(self.mask, coordinate, 0).astype(np.float64)
            if fringe.ideal:
                yield from _sinusoids(fringe, steps, coordinate, shade)
            else:
                for n in steps:
                    yield (shade * fringe.intensity(coordinate, n)).astype(dtype)[None]


def _sinusoids(fringe, steps, coordinate, shade) -> Iterator[np.ndarray]:
    """Shaded steps of Eq. 1, by ``cos(phase + delta)`` taken apart: two cosines serve them all."""
    dtype = shade.dtype.type
    phase = np.remainder(fringe.phase(coordinate), 2 * np.pi).astype(dtype)
    half = shade * dtype(WHITE / 2)
    cosine, sine = half * np.cos(phase), half * np.sin(phase)
    at_once = max(1, CACHED // half.size)
    for first in range(0, len(steps), at_once):
        delta = fringe.shifts[list(steps[first : first + at_once])]
        light = np.multiply.outer(np.cos(delta).astype(dtype), cosine)
        light += half
        light -= np.multiply.outer(np.sin(delta).astype(dtype), sine)
        yield light
