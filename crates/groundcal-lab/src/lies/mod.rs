//! Scenes that break the model: how often is the program confidently wrong?
//!
//! A calibration is only as good as its behaviour where its assumptions fail. This bench draws sets of pictures as people take them, by
//! the hundred: cameras turned from the hand, heads that are not level, a ramp in the floor, a zoomed lens, a mirrored picture, periodic
//! tiles; from points and rendered. It knows nothing of the estimator's model: cameras, lenses, floors, textures, noise and random numbers
//! are its own, and it calls the program by the front door alone, with the options such a user would give.
//!
//! A **lie** is an answer of which fx, fy, cx or cy is further from the truth than four of its stated standard deviations, whatever is
//! warned. Where several cameras took the pictures, any of them is a right answer.

mod compare;
mod families;
mod family;
mod front_door;
mod kind;
mod optics;
mod pictures;
mod points;
mod pose;
mod random;
mod record;
mod run;
mod scene;
mod studio;
mod surface;
mod table;
mod texture;

pub use compare::compare;
pub use families::families;
pub use family::Family;
pub use kind::{Kind, Medium};
pub use record::{LIE_SIGMAS, SceneRecord, Verdict, csv, read_json_lines, to_json_lines};
pub use run::{Timed, export, run, schedule};
pub use table::{Totals, table, totals, warnings_table};
