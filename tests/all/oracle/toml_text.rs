//! Design files: the same keys in many spellings.

use super::design::{Design, Thermometer};
use super::number::{CastTo, Overflow, Rounding};
use crate::rng::Rng;

/// One table: its name, its `key = value` pairs, and sub-tables with the same.
struct Table {
    name: &'static str,
    keys: Vec<(String, String)>,
    subtables: Vec<(String, Vec<(String, String)>)>,
}

/// Prints a design; without a generator in the one plain spelling, with one in
/// a random spelling of the same values.
pub struct Printer {
    style: Option<Rng>,
}

impl Printer {
    /// Every key in the contract's order, every part of a cast written out.
    pub fn plain() -> Self {
        Self { style: None }
    }

    /// A random spelling.
    pub fn random(rng: &mut Rng) -> Self {
        Self {
            style: Some(Rng::new(rng.next_u64())),
        }
    }

    fn chance(&mut self, percent: u64) -> bool {
        self.style.as_mut().is_some_and(|rng| rng.chance(percent))
    }

    fn integer(&mut self, value: i64) -> String {
        if self.chance(90) || self.style.is_none() {
            return value.to_string();
        }
        if value >= 0 && self.chance(50) {
            return format!("0x{value:X}");
        }
        let digits = value.unsigned_abs().to_string();
        let mut text = String::new();
        for (at, digit) in digits.chars().enumerate() {
            if at > 0 && (digits.len() - at).is_multiple_of(3) {
                text.push('_');
            }
            text.push(digit);
        }
        if value < 0 { format!("-{text}") } else { text }
    }

    fn real(&mut self, value: f64) -> String {
        if value.fract() == 0.0 && value.abs() < 1e15 && self.chance(40) {
            return format!("{}", value as i64);
        }
        format!("{value:?}")
    }

    /// The string or the `key = value` pairs of a cast.
    fn cast_parts(&mut self, cast: &CastTo) -> Result<String, Vec<(String, String)>> {
        let default_rounding = cast.rounding == Rounding::HalfUp;
        let default_overflow = cast.overflow == Overflow::Saturate;
        if default_rounding && default_overflow && self.chance(50) {
            return Ok(format!("\"{}\"", cast.format));
        }
        let mut parts = vec![("format".to_owned(), format!("\"{}\"", cast.format))];
        if !(default_rounding && self.chance(60)) {
            let name = cast.rounding.name();
            parts.push(("rounding".to_owned(), format!("\"{name}\"")));
        }
        if !(default_overflow && self.chance(60)) {
            let name = cast.overflow.name();
            parts.push(("overflow".to_owned(), format!("\"{name}\"")));
        }
        self.shuffle(&mut parts);
        Err(parts)
    }

    fn shuffle<T>(&mut self, items: &mut [T]) {
        if let Some(rng) = &mut self.style {
            rng.shuffle(items);
        }
    }

    fn add_cast(&mut self, table: &mut Table, key: &str, cast: &CastTo) {
        match self.cast_parts(cast) {
            Ok(string) => table.keys.push((key.to_owned(), string)),
            Err(parts) => self.add_parts(table, key, parts),
        }
    }

    /// An inline table or a sub-table of its own.
    fn add_parts(&mut self, table: &mut Table, key: &str, parts: Vec<(String, String)>) {
        if self.chance(15) {
            table.subtables.push((key.to_owned(), parts));
            return;
        }
        let inside: Vec<String> = parts.iter().map(|(k, v)| format!("{k} = {v}")).collect();
        table
            .keys
            .push((key.to_owned(), format!("{{ {} }}", inside.join(", "))));
    }

    fn add_integers(&mut self, table: &mut Table, pairs: &[(&str, i64)]) {
        for (key, value) in pairs {
            let text = self.integer(*value);
            table.keys.push(((*key).to_owned(), text));
        }
    }

    fn add_gain(&mut self, table: &mut Table, key: &str, raw: i64, shift: u32) {
        let raw = ("raw".to_owned(), self.integer(raw));
        let shift = ("shift".to_owned(), self.integer(i64::from(shift)));
        self.add_parts(table, key, vec![raw, shift]);
    }

    /// The design file of `design`.
    pub fn print(&mut self, design: &Design) -> String {
        let mut tables = self.front_tables(design);
        tables.extend(self.optional_tables(design));
        self.shuffle(&mut tables);
        let mut text = String::new();
        for table in &mut tables {
            self.shuffle(&mut table.keys);
            text.push_str(&format!("[{}]\n", table.name));
            for (key, value) in &table.keys {
                text.push_str(&format!("{key} = {value}"));
                if self.chance(5) {
                    text.push_str("   # a comment");
                }
                text.push('\n');
            }
            for (name, keys) in &table.subtables {
                text.push_str(&format!("[{}.{name}]\n", table.name));
                for (key, value) in keys {
                    text.push_str(&format!("{key} = {value}\n"));
                }
            }
            text.push('\n');
        }
        text
    }

    fn front_tables(&mut self, design: &Design) -> Vec<Table> {
        let table = |name| Table {
            name,
            keys: Vec::new(),
            subtables: Vec::new(),
        };
        let mut circuit = table("circuit");
        let rate = self.real(design.sample_rate_hz);
        circuit.keys.push(("sample_rate_hz".to_owned(), rate));

        let mut adc = table("circuit.adc");
        let format = format!("\"{}\"", design.adc);
        adc.keys.push(("format".to_owned(), format));

        let mut nco = table("circuit.nco");
        self.add_integers(
            &mut nco,
            &[
                ("phase_bits", i64::from(design.nco.phase_bits)),
                ("tuning_word", design.nco.tuning_word),
                ("table_address_bits", i64::from(design.nco.address_bits)),
            ],
        );
        let rounding = if design.nco.address_half_up {
            "half_up"
        } else {
            "floor"
        };
        nco.keys
            .push(("address_rounding".to_owned(), format!("\"{rounding}\"")));
        nco.keys
            .push(("table".to_owned(), format!("\"{}\"", design.nco.table)));

        let mut demodulator = table("circuit.demodulator");
        self.add_cast(&mut demodulator, "product", &design.product);

        let mut decimator = table("circuit.decimator");
        self.add_integers(
            &mut decimator,
            &[
                ("stages", i64::from(design.stages)),
                ("ratio", i64::from(design.ratio)),
                ("differential_delay", i64::from(design.differential_delay)),
            ],
        );
        self.add_cast(&mut decimator, "output", &design.output);

        let mut cordic = table("circuit.cordic");
        self.add_integers(
            &mut cordic,
            &[
                ("iterations", i64::from(design.cordic.iterations)),
                ("guard_bits", i64::from(design.cordic.guard_bits)),
                ("width", i64::from(design.cordic.width)),
                ("angle_bits", i64::from(design.cordic.angle_bits)),
                ("gain_bits", i64::from(design.cordic.gain_bits)),
            ],
        );
        vec![circuit, adc, nco, demodulator, decimator, cordic]
    }

    fn optional_tables(&mut self, design: &Design) -> Vec<Table> {
        let table = |name| Table {
            name,
            keys: Vec::new(),
            subtables: Vec::new(),
        };
        let mut tables = Vec::new();
        if let Some(control) = &design.phase_loop {
            let mut phase = table("circuit.phase_loop");
            self.add_integers(
                &mut phase,
                &[
                    ("setpoint_raw", control.setpoint_raw),
                    ("integrator_bits", i64::from(control.integrator_bits)),
                ],
            );
            let gain = control.proportional;
            self.add_gain(&mut phase, "proportional", gain.raw, gain.shift);
            let gain = control.integral;
            self.add_gain(&mut phase, "integral", gain.raw, gain.shift);
            tables.push(phase);
        }
        if let Some(control) = &design.amplitude_loop {
            let mut amplitude = table("circuit.amplitude_loop");
            self.add_integers(
                &mut amplitude,
                &[
                    ("setpoint_raw", control.setpoint_raw),
                    ("error_shift", i64::from(control.error_shift)),
                    ("integrator_shift", i64::from(control.integrator_shift)),
                    ("initial_raw", control.initial_raw),
                    ("gain_bits", i64::from(control.gain_bits)),
                ],
            );
            tables.push(amplitude);
        }
        if let Some(compensation) = &design.compensation {
            let mut table = table("compensation");
            match compensation.input {
                Thermometer::Phase => {
                    table
                        .keys
                        .push(("input".to_owned(), "\"phase\"".to_owned()));
                }
                Thermometer::TuningWord {
                    offset_raw,
                    scale_bits,
                } => {
                    table
                        .keys
                        .push(("input".to_owned(), "\"tuning_word\"".to_owned()));
                    table
                        .keys
                        .push(("input_offset_raw".to_owned(), self.integer(offset_raw)));
                    table.keys.push((
                        "input_scale_bits".to_owned(),
                        self.integer(i64::from(scale_bits)),
                    ));
                }
            }
            let coefficients: Vec<String> = compensation
                .coefficients_raw
                .iter()
                .map(|&c| self.integer(c))
                .collect();
            table.keys.push((
                "coefficients_raw".to_owned(),
                format!("[{}]", coefficients.join(", ")),
            ));
            let format = format!("\"{}\"", compensation.coefficient_format);
            table.keys.push(("coefficient_format".to_owned(), format));
            self.add_cast(&mut table, "accumulator", &compensation.accumulator);
            let full_scale = self.real(2f64.powi(compensation.rate_full_scale_log2));
            table
                .keys
                .push(("rate_full_scale_dps".to_owned(), full_scale));
            self.add_cast(&mut table, "output", &compensation.output);
            tables.push(table);
        }
        tables
    }
}
