"""Numbers of engineering: what bounds memory, and what counts as rounding.

None of them changes a result by more than rounding. Those of the tiles of the trellis stand in
`tile`.
"""

import numpy as np

# Trials that are processed at a time, and numbers in an intermediate array.
BATCH = 64
BATCH_NUMBERS = 1 << 20
# Numbers in an array that is used again and again, so that it stays in a processor's cache.
CACHE_NUMBERS = 1 << 17
# Frames of a clip that tell as much as more would.
FRAMES = 100
# A feature whose range is less than this share of its magnitude is constant.
CONSTANT = 2.0**-44
# Distances and costs that differ by less than this share of the energies are equal.
EQUAL = {np.dtype(np.float64): 2.0**-40, np.dtype(np.float32): 2.0**-18}
# Frame rates, and durations, in any unit of time, lie between these.
RATES = 1e-12, 1e12
