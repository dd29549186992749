//! Draws scenes and asks the program, on all threads; each scene hangs on the seed, its family and its number alone.

use std::{path::Path, time::Instant};

use image::{ExtendedColorType, ImageFormat, save_buffer_with_format};
use rayon::prelude::*;

use crate::lies::{
    family::Family, front_door::ask, kind::Medium, pictures::pictures, points::matches, record::SceneRecord,
};

/// For each scene from pictures, which cost seconds, so many from points.
const POINTS_FOR_PICTURES: usize = 3;

/// A record and the time it took.
pub struct Timed {
    /// What became of the scene.
    pub record: SceneRecord,
    /// Time of making and calibrating it, seconds.
    pub seconds: f64,
}

/// Which scenes a run of so many has: family and number, all families in turn, those of pictures less often.
pub fn schedule(families: &[Family], scenes: usize) -> Vec<(Family, usize)> {
    let mut counts = vec![0; families.len()];
    let mut all = Vec::with_capacity(scenes);
    let mut round = 0;
    let only_pictures = families.iter().all(|f| f.medium == Medium::Pictures);
    while all.len() < scenes && !families.is_empty() {
        for (f, count) in families.iter().zip(&mut counts) {
            if all.len() == scenes {
                break;
            }
            if f.medium == Medium::Points || round % POINTS_FOR_PICTURES == 0 || only_pictures {
                all.push((*f, *count));
                *count += 1;
            }
        }
        round += 1;
    }
    all
}

/// Runs scenes; `done` hears of each as it is finished, in any order. The result is in the order of the schedule.
pub fn run(scenes: &[(Family, usize)], seed: u64, done: &(dyn Fn(&Timed) + Sync)) -> Vec<Timed> {
    // One scene at a time to a thread: their costs differ a hundredfold.
    scenes
        .par_iter()
        .with_max_len(1)
        .map(|(family, index)| {
            let begin = Instant::now();
            let scene = family.scene(seed, *index);
            let outcome = ask(&scene, family.medium);
            let key = (family.name, family.kind, family.medium);
            let record = SceneRecord::new(key, (seed, *index), &scene, outcome);
            let timed = Timed { record, seconds: begin.elapsed().as_secs_f64() };
            done(&timed);
            timed
        })
        .collect()
}

/// Writes what the program is given of a scene to a folder (`matches.csv`, or pictures), and its truth, to be looked into.
///
/// # Errors
/// When it cannot be written.
pub fn export(family: &Family, seed: u64, index: usize, folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder)?;
    let scene = family.scene(seed, index);
    let names = scene.names();
    let truth = serde_json::json!({
        "family": family.name, "index": index, "seed": seed, "image_size": scene.size, "truths": scene.truths,
        "pairs": scene.named, "optics": format!("{:?}", scene.views[0].optics),
        "views": scene.views.iter().map(|v| {
            let f = v.pose.rotation.column(2);
            serde_json::json!({
                "pitch_down_deg": (-f.z).clamp(-1.0, 1.0).asin().to_degrees(), "heading_deg": f.y.atan2(f.x).to_degrees(),
                "roll_deg": (-v.pose.rotation[(2, 0)]).atan2(-v.pose.rotation[(2, 1)]).to_degrees(),
                "centre_m": v.pose.centre.as_slice(), "fx": v.optics.fx, "copy_of": v.copy_of,
            })
        }).collect::<Vec<_>>(),
    });
    std::fs::write(folder.join("truth.json"), serde_json::to_string_pretty(&truth)?)?;
    match family.medium {
        Medium::Points => {
            let mut text = String::from("image_a,image_b,xa,ya,xb,yb,sigma_px\n");
            for p in matches(&scene) {
                for m in &p.matches {
                    let (a, b) = (&names[p.from], &names[p.to]);
                    text += &format!("{a},{b},{},{},{},{},{}\n", m.a.x, m.a.y, m.b.x, m.b.y, m.sigma_px);
                }
            }
            std::fs::write(folder.join("matches.csv"), text)?;
        }
        Medium::Pictures => {
            for (name, picture) in names.iter().zip(pictures(&scene)) {
                let bytes: Vec<u8> = picture.data().iter().map(|v| (v * 255.0).round() as u8).collect();
                let (width, height) = (picture.size().width as u32, picture.size().height as u32);
                let path = folder.join(format!("{name}.png"));
                save_buffer_with_format(path, &bytes, width, height, ExtendedColorType::L8, ImageFormat::Png)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lies::families::families;

    #[test]
    fn every_family_makes_scenes_to_calibrate_from() {
        for f in families() {
            for index in 0..2 {
                let scene = f.scene(3, index);
                assert!(scene.views.len() >= 2 && !scene.truths.is_empty(), "{}", f.name);
                let pairs = matches(&scene);
                assert!(!pairs.is_empty(), "{} {index}: no matches", f.name);
                let finite = |m: &groundcal::pairs::PointMatch| m.a.iter().chain(m.b.iter()).all(|v| v.is_finite());
                assert!(pairs.iter().all(|p| p.matches.iter().all(finite)), "{}", f.name);
            }
        }
    }

    #[test]
    fn pictures_come_less_often_than_points() {
        let all = families();
        let scenes = schedule(&all, 1000);
        assert_eq!(scenes.len(), 1000);
        let pictures = scenes.iter().filter(|(f, _)| f.medium == Medium::Pictures).count();
        assert!((50..200).contains(&pictures), "{pictures}");
        assert_eq!(
            schedule(&all, 300).iter().map(|s| s.1).collect::<Vec<_>>(),
            scenes.iter().take(300).map(|s| s.1).collect::<Vec<_>>()
        );
    }
}
