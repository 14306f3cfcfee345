//! What the GPU tests share.
#![allow(dead_code, reason = "each test binary uses its part")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::sync::Arc;

use fathomless::gpu::{Direct, Gpu, GpuConfig};

/// A headless device under the validation layer. Where there is none this fails and says what to install.
pub fn gpu() -> Arc<Gpu> {
    Gpu::new(&Direct, &GpuConfig { validate: true }).unwrap_or_else(|error| panic!("{error:#}"))
}

/// Ends a test: this is the last handle, so the device closes (leaks are reported then), and there was no message.
pub fn assert_clean(gpu: Arc<Gpu>) {
    let log = gpu.validation_log();
    drop(Arc::into_inner(gpu).expect("everything made from the device is dropped by now"));
    let report = log.report();
    assert_eq!(report.count, 0, "validation messages:\n{}", report.texts.join("\n"));
}
