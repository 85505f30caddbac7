"""Classes from any 2D segmentation: files, exported networks or published models, fused over the input views."""
