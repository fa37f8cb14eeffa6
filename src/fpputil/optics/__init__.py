"""Forward: fringes, a camera and a projector, and what the camera sees (chapters 1 and 2)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=["blender", "parts", "shapes"],
    submod_attrs={
        "fringes": ["Fringe", "fringe_set"],
        "graycode": ["GrayCode", "gray_code"],
        "pinhole": ["Pinhole", "camera_matrix", "looking"],
        "system": [
            "Pitches",
            "Preset",
            "System",
            "from_blender",
            "load_system",
            "preset",
            "table2",
        ],
        "raycasting": ["bvh", "raycast"],
        "view": ["View"],
        "shapes": ["genus", "load_mesh"],
    },
)
