"""Errors of the schemes: against their cost, by scene, by law."""
