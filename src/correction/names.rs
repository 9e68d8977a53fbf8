//! Names of a correction's inputs in its sources: what each measures.

use super::plan::{MOST_INPUTS, Plan};
use crate::design::record_columns::unit_of;

type Names = [&'static str; MOST_INPUTS];

/// The first input of a quantity has its name, the others that with their number.
macro_rules! quantity {
    ($name:literal) => {
        [
            $name,
            concat!($name, "_2"),
            concat!($name, "_3"),
            concat!($name, "_4"),
            concat!($name, "_5"),
            concat!($name, "_6"),
            concat!($name, "_7"),
            concat!($name, "_8"),
        ]
    };
}

/// Of a column: by its own name where the contract has it, else by its unit. None is a word of a chain's row
/// (`phase`, `tuning_word`): both stand in one call.
fn of_column(column: &str) -> Names {
    match column {
        "phase_rad" => quantity!("drive_phase"),
        "freq_hz" => quantity!("drive_frequency"),
        "die_degc" => quantity!("die_temperature"),
        "chamber_degc" => quantity!("chamber_temperature"),
        "agc" => quantity!("drive_gain"),
        "quad_dps" => quantity!("quadrature"),
        "supply_v" => quantity!("supply_voltage"),
        _ => match unit_of(column) {
            "degC" => quantity!("temperature"),
            "rad" => quantity!("angle"),
            "Hz" => quantity!("frequency"),
            "deg/s" | "mdeg/s" | "rad/s" => quantity!("turn_rate"),
            "g" => quantity!("acceleration"),
            "V" | "mV" => quantity!("voltage"),
            "A" | "mA" => quantity!("current"),
            "Pa" | "hPa" => quantity!("pressure"),
            "s" | "ms" => quantity!("elapsed_time"),
            _ => quantity!("auxiliary"),
        },
    }
}

impl Plan {
    /// The parameter of each input in the sources, in order: what the input measures, numbered from the second of a kind.
    pub fn input_names(&self) -> Vec<&'static str> {
        let inputs = self.inputs.iter().take(MOST_INPUTS);
        let kinds: Vec<Names> = inputs.map(|input| of_column(&input.column)).collect();
        let name = |(k, kind): (usize, &Names)| {
            let before = kinds.iter().take(k).filter(|other| *other == kind);
            kind.get(before.count()).copied().unwrap_or_default()
        };
        kinds.iter().enumerate().map(name).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correction::{Correction, Input, Term};

    fn plan(columns: &[&str]) -> Plan {
        let input = |column: &&str| Input {
            column: (*column).to_owned(),
            offset: 0.0,
            scale: 1.0,
        };
        Plan {
            period_s: 1.0,
            inputs: columns.iter().map(input).collect(),
            full_scale_dps: 500.0,
            terms: vec![Term::Product {
                gain_dps: 1.0,
                factors: vec![(0, 1)],
            }],
        }
    }

    #[test]
    fn an_input_is_named_after_what_it_measures() {
        let columns = [
            "board_degc",
            "die_degc",
            "lid_degc",
            "supply_v",
            "phase_rad",
            "humidity",
            "die_degc",
            "accel_g",
        ];
        let names = [
            "temperature",
            "die_temperature",
            "temperature_2",
            "supply_voltage",
            "drive_phase",
            "auxiliary",
            "die_temperature_2",
            "acceleration",
        ];
        let plan = plan(&columns);
        assert_eq!(plan.input_names(), names);
        // The parameters are these, between the restart and the rate.
        let program = Correction::auto(&plan).expect("a correction").trace();
        let function = program.functions.last().expect("a function");
        let parameters: Vec<&str> = function.inputs.iter().map(|(port, _)| port.name).collect();
        assert_eq!(parameters.first(), Some(&"restart"));
        assert_eq!(parameters[1..=names.len()], names);
        assert_eq!(parameters.last(), Some(&"rate"));
    }

    #[test]
    fn eight_of_a_kind_have_eight_names() {
        for column in ["die_degc", "gy_dps", "flow", "vbat_mv", "time_s"] {
            let names = plan(&[column; MOST_INPUTS]).input_names();
            let distinct: std::collections::BTreeSet<_> = names.iter().collect();
            assert_eq!(distinct.len(), MOST_INPUTS, "{names:?}");
            assert!(names.iter().all(|name| !name.is_empty()), "{names:?}");
        }
    }
}
