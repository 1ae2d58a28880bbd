"""Tools that do not depend on granular flow: checks, files, notebooks, resources."""
