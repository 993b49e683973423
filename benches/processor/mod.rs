//! Processor time of the measuring thread, for Criterion.

use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use morphcog::base::clock::thread_time;
use std::time::Duration;

/// Measures the processor time of the measuring thread.
pub struct Processor;

impl Measurement for Processor {
    type Intermediate = Duration;
    type Value = Duration;

    fn start(&self) -> Duration {
        thread_time()
    }

    fn end(&self, begin: Duration) -> Duration {
        thread_time() - begin
    }

    fn add(&self, a: &Duration, b: &Duration) -> Duration {
        *a + *b
    }

    fn zero(&self) -> Duration {
        Duration::ZERO
    }

    fn to_f64(&self, value: &Duration) -> f64 {
        value.as_nanos() as f64
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter()
    }
}
