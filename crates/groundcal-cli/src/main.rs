//! The groundcal program.
fn main() {}
