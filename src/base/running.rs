//! [`Running`]: a command that ends with its owner.

use std::process::Child;

/// A process that is ended on drop, so that an error leaves none behind.
pub(crate) struct Running(pub(crate) Child);

impl Drop for Running {
    fn drop(&mut self) {
        // A process that has ended cannot be killed; nothing helps against either error.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
