"""Prints name, type, shape and sum of every array of an archive as JSON."""

import json
import sys

import numpy as np

with np.load(sys.argv[1]) as archive:
    arrays = {name: archive[name] for name in archive.files}
print(json.dumps({
    name: {"dtype": str(a.dtype), "shape": list(a.shape), "sum": float(np.nansum(a, dtype=np.float64))}
    for name, a in arrays.items()
}))
