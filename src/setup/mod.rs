//! What gprop needs beside itself: ONNX Runtime and SAM, found or fetched, always checked.
