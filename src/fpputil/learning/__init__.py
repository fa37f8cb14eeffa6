"""Training, evaluation and prediction (chapter 8)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "config": ["TrainingConfig"],
        "training": ["fit"],
        "weights": ["Trained", "load_weights", "read_metrics", "save_weights"],
        "log": ["plot_log", "read_log"],
        "metrics": ["Score", "errors", "spikes"],
        "evaluation": ["Prediction", "evaluate", "open_split", "predict_batch", "predictions"],
        "uncertainty": [
            "Uncertainty",
            "assess_uncertainty",
            "calibrate_uncertainty",
            "doubt",
            "uncertainty_of",
        ],
        "prediction": [
            "check_photographs",
            "expected_photographs",
            "wrong_photographs",
            "predict",
            "warnings",
        ],
    },
)
