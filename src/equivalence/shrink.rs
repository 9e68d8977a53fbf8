//! Shrinks a stimulus that makes something fail, and writes it as a capture.

use crate::design::Design;

/// Runs that a shrinking may take: a count, not a time, so that the result is always the same.
pub const MOST_RUNS: usize = 400;

/// A shorter stimulus on which `fails` still holds: the shortest prefix found by bisection (a failure
/// at one sample does not depend on later ones), then zeros for as many chunks as possible, halving their length
/// (delta debugging: Zeller and Hildebrandt 2002), then chunks left out, then the prefix once more. At most
/// `most_runs` calls. A stimulus that does not fail is returned as it is.
pub fn shrink(
    drive: &[i32],
    sense: &[i32],
    most_runs: usize,
    fails: &dyn Fn(&[i32], &[i32]) -> bool,
) -> (Vec<i32>, Vec<i32>) {
    let mut shrinker = Shrinker {
        drive: drive.to_vec(),
        sense: sense.to_vec(),
        left: most_runs,
        fails,
    };
    if shrinker.try_it(drive.to_vec(), sense.to_vec()) {
        shrinker.prefix();
        shrinker.zero();
        shrinker.remove();
        shrinker.prefix();
    }
    (shrinker.drive, shrinker.sense)
}

struct Shrinker<'a> {
    drive: Vec<i32>,
    sense: Vec<i32>,
    left: usize,
    fails: &'a dyn Fn(&[i32], &[i32]) -> bool,
}

impl Shrinker<'_> {
    /// Takes the codes over if they still fail.
    fn try_it(&mut self, drive: Vec<i32>, sense: Vec<i32>) -> bool {
        if self.left == 0 {
            return false;
        }
        self.left -= 1;
        let fails = (self.fails)(&drive, &sense);
        if fails {
            (self.drive, self.sense) = (drive, sense);
        }
        fails
    }

    fn prefix(&mut self) {
        let (mut passes, mut fails) = (0, self.drive.len());
        while passes + 1 < fails && self.left > 0 {
            let middle = passes + (fails - passes) / 2;
            let drive = self.drive.get(..middle).unwrap_or_default().to_vec();
            let sense = self.sense.get(..middle).unwrap_or_default().to_vec();
            if self.try_it(drive, sense) {
                fails = middle;
            } else {
                passes = middle;
            }
        }
    }

    fn zero(&mut self) {
        let mut length = self.drive.len();
        while length > 0 && self.left > 0 {
            for start in (0..self.drive.len()).step_by(length) {
                for sense_too in [false, true] {
                    let (mut drive, mut sense) = (self.drive.clone(), self.sense.clone());
                    let codes = if sense_too { &mut sense } else { &mut drive };
                    let chunk = codes.iter_mut().skip(start).take(length);
                    let mut changed = false;
                    for code in chunk {
                        changed |= *code != 0;
                        *code = 0;
                    }
                    if changed {
                        self.try_it(drive, sense);
                    }
                }
            }
            length /= 2;
        }
    }

    fn remove(&mut self) {
        let mut length = self.drive.len() / 2;
        while length > 0 && self.left > 0 {
            let mut start = 0;
            while start < self.drive.len() && self.left > 0 {
                let (mut drive, mut sense) = (self.drive.clone(), self.sense.clone());
                let end = (start + length).min(drive.len());
                drive.drain(start..end);
                sense.drain(start..end);
                if drive.is_empty() || !self.try_it(drive, sense) {
                    start += length;
                }
            }
            length /= 2;
        }
    }
}

/// Codes as a capture in CSV, with what is known of it in comments; `replay --capture` and `equiv --capture` read
/// it.
pub fn capture_text(design: &Design, drive: &[i32], sense: &[i32]) -> String {
    use std::fmt::Write as _;
    let circuit = &design.circuit;
    let mut text = format!(
        "# fs_hz = {}\n# adc_bits = {}\n",
        circuit.sample_rate_hz,
        circuit.adc.format.bits()
    );
    // The key counts in 2^-32 turn; a finer word has no place in it.
    let below = circuit.nco.phase_bits as i32 - 32;
    let word = i128::from(circuit.nco.tuning_word).rem_euclid(1i128 << circuit.nco.phase_bits);
    let ftw = if below > 0 {
        (word & ((1 << below) - 1) == 0).then_some(word >> below)
    } else {
        Some(word << -below)
    };
    if let Some(ftw) = ftw {
        // Writing to a string does not fail.
        _ = writeln!(text, "# ftw = {ftw}");
    }
    text += "drive_code,sense_code\n";
    for (d, s) in drive.iter().zip(sense) {
        _ = writeln!(text, "{d},{s}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::template::default_design;

    #[test]
    fn one_bad_pair_is_what_is_left() {
        let drive: Vec<i32> = (0..1000).collect();
        let sense: Vec<i32> = (0..1000).map(|k| k % 7 + 1).collect();
        let fails = |d: &[i32], _: &[i32]| d.contains(&700);
        let (d, s) = shrink(&drive, &sense, MOST_RUNS, &fails);
        assert_eq!((d, s), (vec![700], vec![0]));
    }

    #[test]
    fn what_depends_on_length_keeps_its_length_and_loses_its_values() {
        let drive = vec![3; 777];
        let fails = |d: &[i32], s: &[i32]| d.len() >= 100 && s.last() == Some(&5);
        let mut sense = vec![1; 777];
        sense[400] = 5;
        sense[776] = 5;
        let (d, s) = shrink(&drive, &sense, 2000, &fails);
        assert_eq!(d, vec![0; 100]);
        assert_eq!(s.iter().filter(|c| **c != 0).count(), 1);
    }

    #[test]
    fn runs_are_counted_and_a_stimulus_that_passes_is_left_alone() {
        let count = std::cell::Cell::new(0);
        let fails = |d: &[i32], _: &[i32]| {
            count.set(count.get() + 1);
            d.iter().map(|c| i64::from(*c)).sum::<i64>() > 5000
        };
        let drive = vec![17; 4000];
        let (d, _) = shrink(&drive, &drive, 60, &fails);
        assert!(count.get() <= 60 && d.len() < 4000, "{}", d.len());
        let passes = shrink(&drive, &drive, 60, &|_, _| false);
        assert_eq!(passes, (drive.clone(), drive));
    }

    #[test]
    fn the_text_is_a_capture() {
        let design = default_design().expect("the default");
        let text = capture_text(&design, &[1, -2], &[3, 0]);
        let expected = "# fs_hz = 56000\n# adc_bits = 16\n# ftw = 134217728\ndrive_code,sense_code\n1,3\n-2,0\n";
        assert_eq!(text, expected);
    }
}
