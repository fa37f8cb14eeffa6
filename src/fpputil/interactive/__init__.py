"""Figures to play with, without a network and without a kernel."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "live": ["Live", "explore", "maps", "slider", "sortable", "space"],
        "figures": ["bench", "box", "cloud", "phasor", "plan", "vernier"],
    },
)
