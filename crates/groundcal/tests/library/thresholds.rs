//! `docs/thresholds.md` against the code: every row is a constant with that value, and every constant that decides something has a row.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

/// Constants that decide nothing: sizes of blocks and tables, names, places of numbers, versions, widths of vector registers.
const NO_THRESHOLDS: [&str; 50] = [
    "ALL",
    "AREA",
    "ASPECT",
    "BLOCK",
    "CHUNK",
    "CLEAR_TURN",
    "COLUMNS",
    "COUNT",
    "DECENTRING",
    "DEPARTURES",
    "DESCRIPTOR_LENGTH",
    "FIRST_CAMERA",
    "FORMAT_VERSION",
    "FRAME",
    "FRAME_HEIGHT",
    "FRAME_POSE",
    "FRAME_YAW",
    "GROUP",
    "GROUP_HEIGHT",
    "INTRINSIC_NAMES",
    "KINDS",
    "LANES",
    "LENS_MAY_BE_OFF_AXIS",
    "LENS_ON_AXIS_ASSUMED",
    "MATRIX",
    "MAX_CAMERA_NUMBERS",
    "MAX_LENS_PARAMETERS",
    "NONE",
    "NOWHERE",
    "NUMBERS",
    "OF_POSE",
    "PARAMETERS",
    "PARAMETER_NAMES",
    "POSE",
    "PRODUCT_BLOCK",
    "RELEASES",
    "RESIDUALS_BELOW_NOISE",
    "RIG_POSE",
    "ROTATION",
    "ROUND",
    "SAMPLE_SIZE",
    "SCHEMA_VERSION",
    "SIXTH",
    "SKEW",
    "TAU",
    "TILT_DOWN",
    "TOGETHER",
    "VIEW",
    "WARNED_PRIORS",
    "WIDE",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Constants at the top level of the files of a folder, outside of tests: (file, name, value without blanks).
fn constants(folder: &Path, source: &Path, found: &mut BTreeSet<(String, String, String)>) {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            if !path.ends_with("tests") {
                constants(&path, source, found);
            }
        } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
            let file = path.strip_prefix(source).expect("inside").to_string_lossy().replace('\\', "/");
            let text = fs::read_to_string(&path).expect("text");
            let code = text.split("\nmod tests {").next().unwrap_or_default();
            for line in code.split('\n').enumerate().filter(|(_, l)| l.starts_with("const ") || l.starts_with("pub")) {
                let (number, line) = line;
                let Some((_, after)) = line.split_once("const ") else {
                    continue;
                };
                let Some((name, rest)) = after.split_once(": ") else { continue };
                if name.len() < 2 || !name.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_') {
                    continue;
                }
                // The value may go on over lines.
                let whole =
                    std::iter::once(rest).chain(code.split('\n').skip(number + 1)).collect::<Vec<_>>().join(" ");
                let Some((_, value)) = whole.split_once(" = ") else { continue };
                let end = value.find(';').unwrap_or(value.len());
                found.insert((file.clone(), name.to_string(), squeezed(&value[..end])));
            }
        }
    }
}

fn squeezed(text: &str) -> String {
    text.chars().filter(|c| !c.is_whitespace()).collect::<String>().replace(",]", "]").replace(",)", ")")
}

#[test]
fn the_table_of_thresholds_is_that_of_the_code() {
    let page = root().join("docs/thresholds.md");
    let Ok(text) = fs::read_to_string(&page) else {
        println!("skipped: {} is not there", page.display());
        return;
    };
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut code = BTreeSet::new();
    constants(&source, &source, &mut code);
    assert!(code.len() > 250, "{} constants", code.len());
    let mut table = BTreeSet::new();
    let kinds = ["level", "measurement", "distribution", "derived", "published", "default", "effort", "choice"];
    for row in text.lines().filter(|l| l.starts_with("| `") && l.contains(".rs` |")) {
        let cells: Vec<&str> = row.split(" | ").map(|c| c.trim_matches(|c| c == '|' || c == ' ')).collect();
        let code_of = |cell: &str| cell.trim_matches('`').to_string();
        assert!(kinds.contains(&cells[3]), "{row}");
        assert!(cells.len() >= 6 && cells[4].len() > 5, "a threshold without a meaning: {row}");
        table.insert((code_of(cells[0]), code_of(cells[1]), squeezed(&code_of(cells[2]))));
        // The modules of tests that it names are there.
        for module in cells[cells.len() - 1].split('`').skip(1).step_by(2) {
            let folders = [
                "tests/library",
                "src/pairs/tests",
                "src/refine/tests",
                "src/calibrate/tests",
                "src/plan/tests",
                "src/floor/tests",
            ];
            let krate = Path::new(env!("CARGO_MANIFEST_DIR"));
            let exists = |folder: &&str| krate.join(folder).join(format!("{module}.rs")).exists();
            // Or the tests of its own file.
            let own = source.join(code_of(cells[0]));
            let in_own = own.file_stem().is_some_and(|stem| stem == module)
                && fs::read_to_string(&own).is_ok_and(|code| code.contains("mod tests"));
            assert!(in_own || folders.iter().any(exists), "{module} of {row}");
        }
    }
    let not_in_code: Vec<_> = table.difference(&code).collect();
    assert!(not_in_code.is_empty(), "rows without a constant of that value: {not_in_code:#?}");
    let decides = |c: &&(String, String, String)| !NO_THRESHOLDS.contains(&c.1.as_str());
    let not_in_table: Vec<_> = code.difference(&table).filter(decides).collect();
    assert!(not_in_table.is_empty(), "constants without a row: {not_in_table:#?}");
}
