//! `odometry.csv`: `image` or `time`, then `x`, `y` in metres and `yaw_deg` (or `yaw` or `yaw_rad`, in radians) of a robot's base.
//!
//! With `time` the images are named by their times (1403636579763555584.png): of the units seconds, milli-, micro- and nanoseconds that one is taken
//! in which they lie within the table. Poses between two rows are interpolated.

use std::path::Path;

use groundcal::floor::BasePose;

use crate::{
    error::IoError,
    matches::table::{Row, Table},
    text::{plain, some_of},
};

/// Most rows: hours at a hundred a second.
const MAX_ROWS: usize = 2_000_000;
/// Units of the times in names, in units of those of the table.
const TIME_UNITS: [f64; 7] = [1.0, 1e-3, 1e-6, 1e-9, 1e3, 1e6, 1e9];
/// Names of images that a message shows.
const LISTED: usize = 6;

/// A row with its time, if it has one.
struct Stamped {
    time: f64,
    position_m: [f64; 2],
    yaw_rad: f64,
}

/// Reads the poses of the base at the images of these names, in the order of the table.
///
/// # Errors
/// [`IoError::File`] with the line at fault, and where no image has a pose.
pub fn read_odometry(path: &Path, names: &[String]) -> Result<Vec<BasePose>, IoError> {
    let table = Table::read(path)?;
    let missing = |what: &str| {
        IoError::file(path, format!("no column {what}. Odometry has image or time, x, y, and yaw_deg or yaw (radians)"))
    };
    let yaw =
        ["yaw_deg", "yaw_rad", "yaw"].into_iter().find(|name| table.has(name)).ok_or_else(|| missing("yaw_deg"))?;
    if let Some(column) = ["x", "y"].into_iter().find(|name| !table.has(name)) {
        return Err(missing(column));
    }
    let pose = |row: &Row| -> Result<([f64; 2], f64), IoError> {
        let value = row.number(yaw)?;
        Ok(([row.number("x")?, row.number("y")?], if yaw == "yaw_deg" { value.to_radians() } else { value }))
    };
    if table.has("image") {
        let mut poses = Vec::new();
        table.each(|row| {
            let (position_m, yaw_rad) = pose(&row)?;
            poses.push(BasePose { image: row.name("image")?, position_m, yaw_rad });
            few(&row, poses.len())
        })?;
        return Ok(poses);
    }
    if !table.has("time") {
        return Err(missing("image"));
    }
    let mut rows: Vec<Stamped> = Vec::new();
    table.each(|row| {
        let (time, (position_m, yaw_rad)) = (row.number("time")?, pose(&row)?);
        if rows.last().is_some_and(|last| last.time >= time) {
            return Err(row.fault(format!(
                "the time {time} does not come after that of the row before. Sort the rows by their time"
            )));
        }
        rows.push(Stamped { time, position_m, yaw_rad });
        few(&row, rows.len())
    })?;
    at_images(path, &rows, names)
}

fn few(row: &Row, rows: usize) -> Result<(), IoError> {
    if rows > MAX_ROWS { Err(row.fault(format!("more than {MAX_ROWS} rows. Thin them out"))) } else { Ok(()) }
}

/// The poses at the times that the names say.
fn at_images(path: &Path, rows: &[Stamped], names: &[String]) -> Result<Vec<BasePose>, IoError> {
    let time_of = |name: &String| Path::new(name).file_stem()?.to_str()?.parse::<f64>().ok().filter(|t| t.is_finite());
    let mut times: Vec<(f64, &String)> = names.iter().filter_map(|n| Some((time_of(n)?, n))).collect();
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
        return Err(IoError::file(path, "no poses in it"));
    };
    let within = |unit: f64| times.iter().filter(|(t, _)| (first.time..=last.time).contains(&(t * unit))).count();
    let unit = TIME_UNITS.into_iter().rev().max_by_key(|unit| within(*unit)).filter(|unit| within(*unit) > 0);
    let Some(unit) = unit else {
        return Err(IoError::file(
            path,
            format!(
                "no image has a time between {} and {}. Name the images by their times, or give the poses by the names of the images (a column \
                 image): {}",
                first.time,
                last.time,
                some_of(names.iter().map(String::as_str), LISTED)
            ),
        ));
    };
    Ok(times.into_iter().filter_map(|(t, name)| between(rows, t * unit, name)).collect())
}

/// The pose at a time, between the rows about it.
fn between(rows: &[Stamped], time: f64, name: &str) -> Option<BasePose> {
    let after = rows.partition_point(|r| r.time < time);
    let b = rows.get(after)?;
    let a = rows.get(after.saturating_sub(1))?;
    if time < a.time {
        return None;
    }
    let part = if b.time > a.time { (time - a.time) / (b.time - a.time) } else { 0.0 };
    let turn = b.yaw_rad - a.yaw_rad;
    let turn = turn.sin().atan2(turn.cos());
    Some(BasePose {
        image: plain(name),
        position_m: [0, 1].map(|i| a.position_m[i] + part * (b.position_m[i] - a.position_m[i])),
        yaw_rad: a.yaw_rad + part * turn,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, names: &[&str]) -> Result<Vec<BasePose>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("odometry.csv");
        std::fs::write(&path, text).unwrap();
        let names: Vec<String> = names.iter().map(|n| n.to_string()).collect();
        read_odometry(&path, &names).map_err(|e| e.to_string())
    }

    #[test]
    fn poses_by_name_are_taken_as_they_are() {
        let poses = read("image,x,y,yaw_deg\na.jpg,1,2,90\nb.jpg,1.5,2,180\n", &[]).unwrap();
        assert_eq!((poses[0].image.as_str(), poses[1].position_m), ("a.jpg", [1.5, 2.0]));
        assert!((poses[0].yaw_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn poses_by_time_are_interpolated_across_the_half_turn() {
        let table = "time,x,y,yaw\n10,0,0,3.1\n11,2,1,-3.1\n12,2,1,-3.1\n";
        let poses = read(table, &["frames/10500000000.png", "10000000000.png", "note.png", "99000000000.png"]).unwrap();
        assert_eq!(
            poses.iter().map(|p| p.image.as_str()).collect::<Vec<_>>(),
            ["10000000000.png", "frames/10500000000.png"]
        );
        assert_eq!(poses[1].position_m, [1.0, 0.5]);
        assert!((poses[1].yaw_rad - std::f64::consts::PI).abs() < 1e-9, "{}", poses[1].yaw_rad);
        assert_eq!(read(table, &["10.5.png"]).unwrap()[0].position_m, [1.0, 0.5]);
    }

    #[test]
    fn what_is_missing_or_out_of_order_is_said() {
        assert!(read("image,x,y\na,1,2\n", &[]).unwrap_err().contains("yaw_deg"));
        assert!(read("x,y,yaw\n1,2,3\n", &[]).unwrap_err().contains("no column image"));
        assert!(read("time,x,y,yaw\n2,1,2,3\n1,1,2,3\n", &["1.png"]).unwrap_err().contains("line 3"));
        assert!(
            read("time,x,y,yaw\n2,1,2,3\n3,1,2,3\n", &["a.png"])
                .unwrap_err()
                .contains("Name the images by their times")
        );
    }
}
