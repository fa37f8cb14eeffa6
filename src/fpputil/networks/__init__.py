"""What is learned: SFNet and its rivals, losses, the geometry they decode with (chapters 8, 9)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "unet": ["UNet"],
        "sfnet": ["SFNet", "SFNetMethod"],
        "sido": ["SIDO", "SIDOMethod"],
        "psnet": ["PSNet", "PSNetMethod"],
        "dlalnet": ["DLALNet", "DLALNetMethod"],
        "methods": ["METHODS", "method_of", "settings_of"],
        "losses": [
            "Pixels",
            "Weights",
            "consistency",
            "geometric",
            "mean_absolute",
            "mean_squared",
        ],
        "geometry": ["Geometry"],
        "targets": ["Method", "noiseless", "phase_of", "true_reference"],
        "complexity": ["Cost", "cost"],
    },
)
