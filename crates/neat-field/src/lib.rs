//! neat-field
