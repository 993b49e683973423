//! The morphcog command.

fn main() {}
