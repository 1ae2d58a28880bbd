"""Where runs fail: maps, tables of limits, short waves."""
