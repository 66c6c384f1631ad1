//! Minimum-cost assignment.
