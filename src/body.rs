//! Bodies, which are the simulator's, and their content hashes.

use crate::base::hash;
pub use morphcog_sim::body::*;

/// Returns the content hash of a body: equal bodies, and only those, have equal keys.
pub(crate) fn key(body: &Body) -> [u8; 16] {
    hash::content_key(body.to_string().as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shape_counts_as_well_as_the_voxels() {
        let key = |text: &str| key(&text.parse().unwrap());
        assert_eq!(key("0123/4560"), key(".123\n456."));
        assert_ne!(key("0123"), key("3210"));
        assert_ne!(key("0123/4560"), key("01/23/45/60"));
    }
}
