"""``python -m bench [NAME]``: one of ``BENCHES`` by name, or all of them."""

from __future__ import annotations

import sys

from bench import (
    clearance_bench,
    end_to_end_bench,
    facet_solve,
    observe_bench,
    plan_bench,
    ray_bench,
    scaling_bench,
    tour_bench,
    tour_search_bench,
)

BENCHES = {
    "facets": facet_solve.main,
    "scaling": scaling_bench.main,
    "end-to-end": end_to_end_bench.main,
    "clearance": clearance_bench.main,
    "rays": ray_bench.main,
    "plans": plan_bench.main,
    "observe": observe_bench.main,
    "tour": tour_bench.main,
    "tour-search": tour_search_bench.main,
}

first = sys.argv[1] if len(sys.argv) > 1 else ""
if first in BENCHES:
    del sys.argv[1]  # what follows are that bench's own options
for name in [first] if first in BENCHES else list(BENCHES):
    print(f"\n== {name}", flush=True)
    BENCHES[name]()
