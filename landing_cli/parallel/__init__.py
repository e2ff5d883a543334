"""Fixed chunks of work on threads (default), loky processes or a Dask cluster.

The parent hands out chunks and is the only one that writes what comes back; rows are keyed by
facet, so that any number of jobs and any backend gives the same numbers. Workers may die: what
came is kept, the rest is tried again, and what keeps killing its worker is named.
"""

from landing_cli.parallel.blas import pin_blas_threads
from landing_cli.parallel.chunks import LostChunk
from landing_cli.parallel.plan import BACKENDS, WorkPlan, run_chunks

__all__ = ["BACKENDS", "LostChunk", "WorkPlan", "pin_blas_threads", "run_chunks"]
