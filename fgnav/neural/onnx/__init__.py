"""A stranger's ONNX file: looked through, then run by a process that may crash, hang or grow."""
