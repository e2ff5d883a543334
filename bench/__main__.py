"""``python -m bench``: the facet solve beside its baselines."""

from bench.facet_solve import main

main()
