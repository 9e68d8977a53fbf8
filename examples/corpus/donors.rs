//! Series of real sensors at rest, and what their noise is like: read at run time, never kept.

use crate::blind::dice::seed_of;
use crate::blind::sensor::SensorNoise;
use crate::rng::Rng;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// File, value of its first column where it has several runs, columns, degree of the polynomial in temperature that is
/// taken out first.
const SERIES: [(&str, Option<&str>, i32); 5] = [
    ("lego_hub_rb.csv", None, 5),
    ("lego_hub_rx.csv", None, 5),
    ("bmi270_cold_hot.csv", Some("cold"), 1),
    ("bmi270_cold_hot.csv", Some("hot"), 1),
    ("mpu6050_static.csv", None, 0),
];

/// Number of draws of the family that stands in.
const STAND_INS: u64 = 12;

/// The noise of every series that is there; without any, draws of the family that stands in.
pub fn all() -> Vec<Arc<SensorNoise>> {
    let folder = std::env::var("GYROGEN_SERIES").unwrap_or_else(|_| "../shared/data".to_owned());
    let found: Vec<Arc<SensorNoise>> = SERIES
        .iter()
        .flat_map(|(file, run, degree)| series(&Path::new(&folder).join(file), *run, *degree))
        .map(Arc::new)
        .collect();
    if !found.is_empty() {
        return found;
    }
    eprintln!("no series in {folder}: noise of a stated coloured family stands in");
    (0..STAND_INS)
        .map(|k| Arc::new(SensorNoise::stand_in(&mut Rng::new(seed_of(&[k, 47])))))
        .collect()
}

/// The three axes of a file.
fn series(path: &PathBuf, run: Option<&str>, degree: i32) -> Vec<SensorNoise> {
    let Ok(text) = std::fs::read_to_string(path) else {
        return Vec::new();
    };
    let rows: Vec<&str> = text
        .lines()
        .enumerate()
        .filter(|(k, line)| *k == 0 || run.is_none_or(|r| line.split(',').next() == Some(r)))
        .map(|(_, line)| line)
        .collect();
    let column = |name: &str| crate::blind::score::column(&rows.join("\n"), name);
    let temperature = column("temperature_degc");
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    ["x", "y", "z"]
        .iter()
        .filter_map(|axis| {
            let name = format!(
                "{stem}{}_{axis}",
                run.map_or(String::new(), |r| format!("_{r}"))
            );
            let values = column(&format!("gyro_{axis}_dps"));
            let keep: Vec<usize> = (0..values.len())
                .filter(|k| values[*k].is_finite() && temperature[*k].is_finite())
                .collect();
            let pick = |v: &[f64]| keep.iter().map(|k| v[*k]).collect::<Vec<f64>>();
            SensorNoise::estimate(&name, &pick(&values), &pick(&temperature), degree)
        })
        .collect()
}
