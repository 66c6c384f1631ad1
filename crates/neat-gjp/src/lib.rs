//! neat-gjp
