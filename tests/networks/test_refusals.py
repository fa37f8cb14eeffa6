"""What networks, methods and losses refuse, and in which words."""

import math

import pytest
import torch

from fpputil.networks import (
    DLALNetMethod,
    PSNetMethod,
    SFNet,
    SFNetMethod,
    SIDOMethod,
    Weights,
    cost,
    method_of,
)

SMALL = SFNet(base=2, levels=2)
REFUSALS = [
    (lambda: SFNet(frames=(0, 1)), "frames 0 given"),
    (lambda: SFNet(frames=(1,)), r"frames \(1,\) given; one number for each"),
    (lambda: SFNet(base=True), "base True given"),
    (lambda: SFNet(levels=1), "levels 1 given; a whole number from 2 to 16"),
    (lambda: SFNet(levels=2.5), "levels 2.5 given"),
    (lambda: SFNet(dropout=1), "dropout 1 given"),
    (lambda: SFNet(dropout=math.nan), "dropout nan given"),
    (lambda: SFNet(mixing="some"), "mixing 'some' given; one of none, deepest, every level"),
    (lambda: SFNet(outputs=0), "outputs 0 given"),
    (lambda: SMALL(torch.zeros(1, 3, 8, 8)), r"frames of shape \(.* takes \(B, 2, H, W\)"),
    (lambda: SMALL(torch.zeros(2, 8, 8)), r"frames of shape \(2, 8, 8\) given"),
    (lambda: SFNetMethod(frames=4), "4 frames of each pitch given"),
    (lambda: SFNetMethod(target="depth"), "target 'depth' given"),
    (lambda: SFNetMethod(reference="low"), "reference 'low' given; one of refined, zmin, mid"),
    (lambda: SFNetMethod(weights=None), "weights None given; SFNet needs those of its losses"),
    (lambda: SIDOMethod(base=0), "base 0"),
    (lambda: PSNetMethod(levels=1), "levels 1"),
    (lambda: PSNetMethod(errors="rad"), "errors 'rad' given; one of grey, fringe"),
    (lambda: PSNetMethod(unit_step=4), "unit_step 4 with errors in grey levels given"),
    (lambda: PSNetMethod(errors="fringe", unit_step=15), "unit_step 15 given"),
    (lambda: SIDOMethod(errors="mm"), "errors 'mm' given; one of grey, fringe"),
    (lambda: SIDOMethod(phase_weight=0), "phase_weight 0 given"),
    (lambda: DLALNetMethod(dropout=1.0), "dropout 1.0"),
    (lambda: Weights(phase=-1), "weight of the phase loss -1 given"),
    (lambda: Weights(geometric=math.nan), "weight of the geometric loss nan given"),
    (lambda: Weights(consistency="1"), "weight of the consistency loss '1' given"),
    (lambda: method_of({"method": "unet"}), "method 'unet' is not known"),
    (lambda: method_of({"method": "psnet"}), r"\['base', 'dropout', 'levels'\] needed"),
    (lambda: cost(SMALL, (0, 8)), "height 0"),
    (lambda: cost(SMALL, (8, 2.5)), "width 2.5"),
]


@pytest.mark.parametrize("call, words", REFUSALS)
def test_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call()
