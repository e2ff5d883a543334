"""Questions over many reachable domains: when, how surely, and what each requirement buys.

Each study is a package of its own that asks the facet solver of `landing_cli.reach` and stores a result of
its own kind.
"""
