//! groundcal's laboratory: rendered scenes with truth, the paper's studies, and what only they use.

pub mod division;
pub mod lies;
pub mod render_scene;
pub mod renderer;
pub mod studies;
pub mod subsets;
pub mod transfer;
