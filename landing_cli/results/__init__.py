"""Results on disk: journal, HDF5 store, tables and figures."""
