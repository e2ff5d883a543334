"""``python -m bench [facets | clearance | plans | tour-search]``: our kernels beside what else there is."""

from __future__ import annotations

import sys

from bench import clearance_bench, facet_solve, plan_bench, tour_search_bench

BENCHES = {
    "facets": facet_solve.main,
    "clearance": clearance_bench.main,
    "plans": plan_bench.main,
    "tour-search": tour_search_bench.main,
}

first = sys.argv[1] if len(sys.argv) > 1 else ""
if first in BENCHES:
    del sys.argv[1]  # what follows are that bench's own options
for name in [first] if first in BENCHES else list(BENCHES):
    print(f"\n== {name}", flush=True)
    BENCHES[name]()
