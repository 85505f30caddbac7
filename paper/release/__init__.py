"""Release work: the model card and its failures, NOTICE, the included weights, and the image of the demo."""
