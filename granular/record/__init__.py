"""The HDF5 record of a run; `granular.trajectory` is its public face."""
