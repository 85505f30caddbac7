"""The paper's ablation: trains its variants, evaluates them and prints tables."""
