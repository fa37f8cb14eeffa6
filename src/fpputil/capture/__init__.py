"""Real photographs: patterns to project, a folder to decode, what is wrong with it (chapter 12)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "patterns": ["Patterns"],
        "files.names": ["Shot"],
        "files.images": ["Levels", "levels_of"],
        "photographs": ["Capture", "open_capture", "read_photograph"],
        "virtual": ["photograph", "photograph_into", "save_truth"],
        "faults.gamma": ["estimate_gamma", "harmonic_ratio", "linearise"],
        "measurement": ["Measurement", "measure"],
        "quality": ["Noise", "Reason", "noise_of"],
        "faults.findings": ["FINDINGS", "Finding"],
        "faults.diagnosis": ["diagnose", "mirrored"],
        "depth": ["diagnose_points", "locate"],
        "relief": ["phase_difference", "remove_ground"],
        "report": ["overview"],
        "folder": ["DecodedFolder", "board_pose", "decode_folder"],
    },
)
