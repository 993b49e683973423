//! Floor 4: the logic of every command; reports through observers and never prints.

pub mod data;
