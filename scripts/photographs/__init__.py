"""Houses, façades and tables with exact truth, for scripts/make_photographs.py."""
