"""Tools that know nothing of granular flow: checks, files, notebooks, resources."""
