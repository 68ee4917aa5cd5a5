"""The commands of `engage`, one file each. They put services together; the work is done in the services."""

import os

# Before anything loads numpy: its matrix library would start a thread per core for 3x3 products.
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
