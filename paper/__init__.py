"""The workshop of the paper and of releases: ablation, figures, bench and release tasks. It runs from a clone and is in no wheel."""
