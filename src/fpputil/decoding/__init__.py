"""Inverse: frames to phase, absolute phase and points (chapters 3 to 6)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=["phase", "unwrap"],
    submod_attrs={
        "phase": ["average", "modulation", "numerator_denominator", "wrapped_phase"],
        "unwrap": [
            "TWO_PI",
            "absolute_phase",
            "fringe_order",
            "mf_tpu",
            "mw_tpu",
            "nt_tpu",
            "spatial",
            "wrap",
        ],
        "gray": ["gray_index", "gray_order", "read_cells"],
        "geometric_constraint": [
            "depth_range",
            "minimum_phase",
            "phase_range",
            "refined_reference",
            "two_phase_absolute",
            "zmin_order",
        ],
        "decoder": ["Decoded", "decode"],
        "triangulation": ["column", "depth_of", "intersect", "points_of", "triangulate"],
        "phase_height": ["PhaseHeight", "fit_phase_height"],
        "pointcloud": [
            "clean_points",
            "fit_plane",
            "fit_sphere",
            "point_cloud",
            "save_ply",
            "surface",
            "typical_edge",
        ],
        "fourier": ["carrier", "fourier_phase"],
        "noise": ["order_error_rate", "phase_density", "phase_sigma"],
    },
)
