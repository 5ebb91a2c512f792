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
    decoded = [(entry["segment"], mask.decode(entry["segmentation"])) for entry in annotations]
    found = {
        "annotations": len(annotations),
        "same": all(((labels == segment) == (pixels == 1)).all() for segment, pixels in decoded),
    }
print(json.dumps(found))
