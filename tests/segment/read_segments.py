"""Reads a label map and the same segments in another form, with the libraries that users of that form have."""

import json
import sys

import numpy as np
from PIL import Image

picture = Image.open(sys.argv[1])
labels = np.asarray(picture).astype(int)
if sys.argv[2].endswith(".npy"):
    planes = np.load(sys.argv[2])
    found = {
        "png": picture.mode,
        "dtype": str(planes.dtype),
        "shape": planes.shape,
        "least": int(planes.min()),
        "most": int(planes.max()),
        "same": bool((planes == labels - 1).all()),
    }
else:
    from pycocotools import mask

    annotations = json.load(open(sys.argv[2]))["annotations"]
    parents = {entry["segment"]: entry["parent"] for entry in annotations}
    decoded = [(entry, mask.decode(entry["segmentation"])) for entry in annotations]

    def lies_in(segment, outer):
        while segment is not None and segment != outer:
            segment = parents[segment]
        return segment == outer

    def pixels_of(outer):
        return np.isin(labels, [segment for segment in parents if lies_in(segment, outer)])

    found = {
        "annotations": len(annotations),
        "same": all((pixels_of(entry["segment"]) == (pixels == 1)).all() for entry, pixels in decoded),
        "areas": all(entry["area"] == int(pixels.sum()) for entry, pixels in decoded),
    }
print(json.dumps(found))
