#!/usr/bin/env python3
"""Measures the machine's limits: large f32 matrix products and copies with PyTorch, on one thread and on all.

    pip install torch numpy
    python experiments/bench/machine_limits.py
"""

import os
import sys
import time

try:
    import torch
except ImportError:
    sys.exit("machine_limits.py needs PyTorch: pip install torch numpy")

SIZE, VALUES = 2048, 64 * 1024 * 1024


def best(work, times=8):
    found = []
    for _ in range(times):
        begin = time.perf_counter()
        work()
        found.append(time.perf_counter() - begin)
    return min(found)


for threads in sorted({1, len(os.sched_getaffinity(0))}):
    torch.set_num_threads(threads)
    a, b = torch.randn(SIZE, SIZE), torch.randn(SIZE, SIZE)
    source = torch.randn(VALUES)
    target = torch.empty_like(source)
    product = 2 * SIZE**3 / best(lambda: torch.mm(a, b)) / 1e9
    copied = 2 * 4 * VALUES / best(lambda: target.copy_(source)) / 1e9
    print(f"{threads} threads: {product:.0f} GFLOP/s, {copied:.0f} GB/s read and written")
