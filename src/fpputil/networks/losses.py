"""The losses of SFNet: predicted against true phases in the mask (paper, Eq. 12-15; chapter 8).

Everything is computed on the pixels of the mask alone, gathered first: a NaN or a wild number
outside it can then reach neither a loss nor a gradient. Each loss is one number an image, (B,),
so that a batch means the same however it is dealt out to several devices.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from fpputil.checks import not_negative
from fpputil.decoding.unwrap import wrap

PAPER_PIXELS = 640 * 480  # the sum of Eq. 14 and its weight belong to pictures of this size


@dataclass(frozen=True, eq=False)
class Pixels:
    """The pixels of a batch of masks (B, H, W), and which of them are neighbours.

    `image` (P,) numbers the image of each pixel; `across` and `down` are pairs of (Q,) positions,
    among the P, of pixels that both lie in the mask side by side.

    >>> mask = torch.tensor([[[True, True], [False, True]]])
    >>> pixels = Pixels.of(mask)
    >>> pixels.of_images(torch.tensor([[[1.0, 2.0], [3.0, 4.0]]]))
    tensor([1., 2., 4.])
    >>> pixels.across, pixels.down
    ((tensor([0]), tensor([1])), (tensor([1]), tensor([2])))
    """

    mask: Tensor
    image: Tensor
    across: tuple[Tensor, Tensor]
    down: tuple[Tensor, Tensor]

    @classmethod
    def of(cls, mask: Tensor) -> Pixels:
        """Pixels of a mask (B, H, W)."""
        place = torch.zeros(mask.shape, dtype=torch.int64, device=mask.device)
        image = torch.nonzero(mask)[:, 0]
        place[mask] = torch.arange(len(image), device=mask.device)
        across = mask[..., :, 1:] & mask[..., :, :-1]
        down = mask[..., 1:, :] & mask[..., :-1, :]
        return cls(
            mask,
            image,
            (place[..., :, :-1][across], place[..., :, 1:][across]),
            (place[..., :-1, :][down], place[..., 1:, :][down]),
        )

    def of_images(self, images: Tensor) -> Tensor:
        """Values (P, ...) of images (B, ..., H, W) at the pixels."""
        return images.movedim((-2, -1), (1, 2))[self.mask]

    def total(self, values: Tensor, at: Tensor | None = None) -> Tensor:
        """Sum over each image, (B,), of values (P,), or of values at the pixels `at`."""
        image = self.image if at is None else self.image[at]
        return values.new_zeros(len(self.mask)).index_add(0, image, values)

    def mean(self, values: Tensor, at: Tensor | None = None) -> Tensor:
        """Mean over each image, (B,), 0 where it has no pixel."""
        return self.total(values, at) / self.total(torch.ones_like(values), at).clamp(min=1)


def mean_squared(pixels: Pixels, predicted: Tensor, true: Tensor) -> Tensor:
    """Mean squared error of values (P,) or (P, ...): a term of Eq. 12. Chapter 8.

    >>> pixels = Pixels.of(torch.tensor([[[True, True]], [[True, False]]]))
    >>> mean_squared(pixels, torch.tensor([1.0, 2.0, 3.0]), torch.zeros(3))  # of both images
    tensor([2.5000, 9.0000])
    """
    e = (predicted - true) ** 2
    return pixels.mean(e.flatten(1).mean(1) if e.ndim > 1 else e)


def mean_absolute(pixels: Pixels, predicted: Tensor, true: Tensor) -> Tensor:
    """Mean absolute error of values (P,): ours, in place of the squares of Eq. 12. Chapter 8.

    >>> pixels = Pixels.of(torch.tensor([[[True, True]]]))
    >>> mean_absolute(pixels, torch.tensor([1.0, -2.0]), torch.zeros(2))
    tensor([1.5000])
    """
    return pixels.mean((predicted - true).abs())


def consistency(pixels: Pixels, phi: Tensor, Phi: Tensor) -> Tensor:
    """Squared difference of gradients of phi (P,) and true Phi (P,) (paper, Eq. 13). Chapter 8.

    A wrapped phase jumps, so the difference of the gradients is taken modulo 2 pi; that is the
    difference of the errors of neighbours. It needs both of them inside the mask.

    >>> pixels = Pixels.of(torch.tensor([[[True, True]]]))
    >>> Phi = torch.tensor([3.0, 3.5])  # the wrapped phase jumps between them
    >>> consistency(pixels, wrap(Phi), Phi).round(decimals=4)
    tensor([0.])
    """
    pairs = (pixels.across, pixels.down)
    return sum(pixels.mean(wrap((phi[b] - phi[a]) - (Phi[b] - Phi[a])) ** 2, a) for a, b in pairs)


def geometric(pixels: Pixels, Phi: Tensor, *, mean: bool = False) -> Tensor:
    """Squared differences of neighbouring predicted phases Phi (P,) (paper, Eq. 14). Chapter 8.

    Printed with the true phase, which would be a constant; the predicted one is meant.

    The mean is over the pairs. The sum is scaled to as many pixels as the paper's pictures have,
    so that one weight serves every size.

    >>> pixels = Pixels.of(torch.tensor([[[True, True, True]]]))
    >>> geometric(pixels, torch.tensor([1.0, 2.0, 4.0]), mean=True)
    tensor([2.5000])
    """
    height, width = pixels.mask.shape[-2:]
    scale = 1 if mean else PAPER_PIXELS / (height * width)
    gather = pixels.mean if mean else pixels.total
    pairs = (pixels.across, pixels.down)
    return scale * sum(gather((Phi[b] - Phi[a]) ** 2, a) for a, b in pairs)


@dataclass(frozen=True)
class Weights:
    """Weights of the three losses, and our readings of them (paper, Eq. 15). Chapter 8.

    Parameters
    ----------
    phase, consistency, geometric : float
        The paper's 1, 1e-2, 1e-6.
    order : bool
        Whether a wrong fringe order counts in the last term of Eq. 12, as printed; otherwise
        the absolute phase is compared modulo 2 pi.
    mean : bool
        Whether Eq. 14 is averaged over the pairs, not added up.
    l1 : bool
        Whether Eq. 12 adds up absolute errors, not squares.
    """

    phase: float = 1.0
    consistency: float = 1e-2
    geometric: float = 1e-6
    order: bool = True
    mean: bool = False
    l1: bool = False

    def __post_init__(self):
        for name in ("phase", "consistency", "geometric"):
            not_negative(f"weight of the {name} loss", getattr(self, name))

    def losses(self, pixels: Pixels, components, targets, phi_h, Phi_predicted, Phi) -> dict:
        """Each loss by name and their weighted "total", (B,) each (paper, Eq. 12-15).

        All are (P,): components and targets, sequences of what the network put out and should
        have (M and D of both pitches), predicted phi_h, predicted and true Phi.
        """
        error = mean_absolute if self.l1 else mean_squared
        residual = Phi_predicted - Phi
        residual = residual if self.order else wrap(residual)
        pairs = [*zip(components, targets, strict=True), (residual, torch.zeros_like(residual))]
        parts = {
            "phase": sum(error(pixels, *pair) for pair in pairs),
            "consistency": consistency(pixels, phi_h, Phi),
            "geometric": geometric(pixels, Phi_predicted, mean=self.mean),
        }
        return {**parts, "total": sum(getattr(self, k) * v for k, v in parts.items())}
