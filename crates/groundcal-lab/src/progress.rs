//! Who waits for a study may hear how far it is.

/// Hears of the steps of a long computation, from any thread.
pub trait Progress: Sync {
    /// A stage of `steps` steps begins.
    fn begin(&self, stage: &str, steps: u64);
    /// One step is done.
    fn advance(&self);
    /// No more steps come.
    fn finish(&self);
    /// Whether the work is to stop. Asked before every step of a study.
    fn stopped(&self) -> bool {
        false
    }
}

/// Says nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _: &str, _: u64) {}
    fn advance(&self) {}
    fn finish(&self) {}
}
