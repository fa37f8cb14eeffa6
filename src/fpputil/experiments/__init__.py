"""The runs behind Tables 3 to 6, and what they say (chapters 10 and 11)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "rows": ["ROWS", "SEEDS", "finished", "run_names"],
        "registry": ["Experiment", "budget", "experiments", "recipe"],
        "runs": ["load", "make_run", "read_results", "training_cost", "training_speed"],
        "learning_rate": ["search_learning_rate"],
        "assessment": ["assess"],
        "error_analysis": ["ErrorAnalysis"],
        "statistics": ["bootstrap", "difference", "power_law", "seed_variation"],
        "tables": ["table"],
    },
)
