"""The network in ONNX: one file that other programs run without PyTorch."""
