"""The documents that the package implements, figure by figure."""
