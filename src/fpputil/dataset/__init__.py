"""SynthFringe: views of many models, for networks to learn from (chapter 7)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "models": ["Model", "load_model", "mesh_folder", "parts", "seeded_models", "thingi10k"],
        "generation": ["generate"],
        "store": ["Store", "check_files", "open_store"],
        "augmentation": ["Augmentation"],
        "synthesis": ["ViewMaps", "synthesise"],
        "synthfringe": ["SynthFringe"],
        "folders": ["export_folder", "import_folder"],
    },
)
