"""Released networks at work: numpy and onnxruntime, never torch."""
