"""A board, a camera and a projector (chapter 12)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "board": ["Board"],
        "placement": ["PlacedBoard", "place_boards"],
        "stereo": ["BoardView", "StereoFit", "calibrate_pair"],
        "zhang": ["Calibration", "Pose", "calibrate"],
    },
)
