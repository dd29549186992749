//! What a run writes into a folder: nothing of the user's is lost, nothing of two runs is mixed.
//!
//! ```text
//! FOLDER/.groundcal-manifest.json     the files that runs wrote here, with size and SHA-256: by these a file is known as ours
//! FOLDER/.groundcal-run/lock          locked while a run is at work; the system lets go of it when the process ends, however it ends
//! FOLDER/.groundcal-run/new/NAME      results, until all are there
//! FOLDER/.groundcal-run/journal.json  from here on the run counts: what is to be moved into place, what of an earlier run goes
//! ```
//!
//! 1. [`Outputs::begin`], before any work: finishes or clears away what a killed run left, then refuses names that two results share, that an
//!    input has, or that a file has which no run wrote or which was changed since.
//! 2. [`Outputs::write`]: into `new/`.
//! 3. [`Outputs::commit`]: looks at the folder again, writes the journal, moves the files into place, takes away those of an earlier run
//!    that have no successor, writes the manifest.
//!
//! A run that is killed before the journal is there leaves the old files as they were; one that is killed after it is finished by the next
//! run. `manifest` is the list, `claim` the folder and its lock, `check` the rules, `journal` the moving.

mod check;
mod claim;
mod digest;
mod journal;
mod manifest;
mod run;

pub use check::check_folder;
pub use digest::sha256;
pub use manifest::MANIFEST;
pub use run::{Abandon, Outputs, Request, Written};

#[cfg(test)]
mod tests;
