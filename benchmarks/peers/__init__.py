"""Other codes on the same columns."""
