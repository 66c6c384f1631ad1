//! neat
fn main() {}
