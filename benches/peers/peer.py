"""What every peer shares: inputs from files of little-endian doubles, and runs on demand.

The driver writes a command a line to the standard input: `run` answers the seconds of one run, `save PATH` writes the last result,
`memory` answers the peak of the resident memory in MiB.
"""

import sys
import time
from pathlib import Path

import numpy as np
from memory import peak_mib

FOLDER = Path(sys.argv[1])
THREADS = int(sys.argv[2])
# A run is repeated until it takes so long, seconds.
LEAST = 0.02


def real(name, *shape):
    return np.fromfile(FOLDER / f"{name}.f64", dtype="<f8").reshape(shape)


def complex_(name, *shape):
    return np.fromfile(FOLDER / f"{name}.f64", dtype="<c16").reshape(shape)


def serve(run):
    run()
    print("ready", flush=True)
    result = None
    for line in sys.stdin:
        words = line.split()
        if words[0] == "run":
            start, count = time.perf_counter(), 0
            while count == 0 or time.perf_counter() - start < LEAST:
                result = run()
                count += 1
            print((time.perf_counter() - start) / count, flush=True)
        elif words[0] == "save":
            np.ascontiguousarray(result).tofile(words[1])
            print("saved", flush=True)
        elif words[0] == "memory":
            print(peak_mib(), flush=True)
