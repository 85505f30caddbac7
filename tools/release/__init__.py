"""Release work: the model card and its failures, NOTICE, the weights that ship, and the picture of the demo."""
