//! Joint refinement of cameras, lenses, attitudes, frames and points: planar bundle adjustment.
//!
//! ```text
//! minimise   Σ_tracks Σ_images huber( |x_qf - π(K, k, R, t, A_g, δ_f, ψ_f, c_f, q)|²_Λ )
//!          + Σ_f |δ_f|² / σ_a²  +  Σ_f (ln h_f - ln h_g)² / σ_h²  +  Σ_i (p_i - p̄_i)² / σ_i²
//! ```
//!
//! with x_qf the pixel at which frame f shows the point q of a track, π of `residual`, (K, k) a camera and its lens, (R, t) its pose in the rig,
//! c_f = (x, y, h) the optical centre, huber the loss (|r|² up to a limit, linear in |r| beyond), Λ the inverse covariance of an observation. σ_a, the attitude error of each frame against
//! that of its group, and σ_h, how far its height does, are variance components: 0 for exact plane-normal motion at constant
//! height (KZR's model), infinite for general motion (Triggs 1998); where nothing is said of them they are estimated by restricted
//! likelihood.
//!
//! The unknowns are `blocks`; the `layout` says where each stands. Numbers of the lens that are held until the residuals ask for them
//! are released by a score test (`release`). The points are eliminated (`elimination`); what is left is
//! sparse (`skyline`). [`adjust()`] goes round: minimise, `reweight`, `variance_components`; in the end
//! `covariance` and `profile`. What an alternative would gain is looked at (`prospect`) before it is tried.

pub(crate) mod adjust;
pub(crate) mod blocks;
pub(crate) mod bundle;
pub(crate) mod covariance;
mod effects_by_parts;
pub(crate) mod elimination;
pub(crate) mod evidence;
pub(crate) mod layout;
pub(crate) mod lever;
pub(crate) mod many_effects;
pub(crate) mod problem;
pub(crate) mod profile;
pub(crate) mod prospect;
pub(crate) mod release;
pub(crate) mod residual;
pub(crate) mod reweight;
pub(crate) mod score;
pub(crate) mod start;
pub(crate) mod tracks;
pub(crate) mod turned;
pub(crate) mod variance_components;

pub(crate) use blocks::BundleOptions;
pub(crate) use blocks::CameraState;
pub(crate) use blocks::CameraUnknowns;
pub(crate) use blocks::DepartureKind;
pub(crate) use blocks::State;
pub(crate) use bundle::Bundle;
pub(crate) use bundle::CameraEstimate;
pub(crate) use bundle::GroupEstimate;
pub(crate) use bundle::JointCovariance;
pub(crate) use bundle::ViewEstimate;
pub(crate) use residual::SceneModel;
pub(crate) use tracks::Kind;
pub(crate) use tracks::Observation;
pub(crate) use tracks::Track;
pub(crate) use variance_components::disagreement;

#[cfg(test)]
mod tests;
