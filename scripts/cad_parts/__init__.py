"""Everyday parts with exact truth, for scripts/make_parts.py."""
