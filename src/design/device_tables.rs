//! `name`, `[gyro]`, `[thermal_run]` and `[fit]`: each key that a file leaves out has
//! the default design's value.

use super::effects;
use super::schema::*;
use super::table::{Real, Table, Value};
use crate::error::Result;

/// Words that C, C++ or Rust keep for themselves.
const KEYWORDS: &str = " \
    abstract alignas alignof and and_eq as asm async auto await become bitand bitor bool box break case catch char \
    class compl concept const consteval constexpr constinit continue crate decltype default delete do double dyn else \
    enum explicit export extern false final float fn for friend gen goto if impl in inline int let long loop macro \
    match mod move mut mutable namespace new noexcept not not_eq nullptr operator or or_eq override priv private \
    protected pub public ref register requires restrict return self short signed sizeof static static_assert struct \
    super switch template this thread_local throw trait true try type typedef typeid typename typeof typeof_unqual \
    union unsafe unsigned unsized use using virtual void volatile where while xor xor_eq yield ";

/// Names whose C type `NAME_t`, or whose Rust crate, exists already.
const TAKEN: &str = " \
    alloc blkcnt blksize clock clockid core daddr dev div errno fenv fexcept fpos fsblkcnt fsfilcnt fsid gid id imaxdiv \
    ino int16 int32 int64 int8 int_fast16 int_fast32 int_fast64 int_fast8 int_least16 int_least32 int_least64 \
    int_least8 intmax intptr key ldiv lldiv loff max_align mbstate mode nlink off pid proc_macro ptrdiff quad rsize sig_atomic size ssize std suseconds test time timer u_int16 u_int32 u_int64 u_int8 u_quad uid uint16 uint32 \
    uint64 uint8 uint_fast16 uint_fast32 uint_fast64 uint_fast8 uint_least16 uint_least32 uint_least64 uint_least8 \
    uintmax uintptr useconds va_list wchar wctrans wctype wint ";

/// Reads `name`: the prefix of everything that is emitted, in C and in C++, and the name of a crate in Rust.
pub(super) fn name(value: Value) -> Result<String> {
    let name = value.text("the design's name")?;
    match unfit(name) {
        None => Ok(name.to_owned()),
        Some(reason) => Err(value
            .error(format!("= {} {reason}", value.shown()))
            .help(NAME_HELP)
            .into()),
    }
}

/// What a name has to look like.
pub const NAME_HELP: &str = "start with a lower-case ASCII letter, go on with such letters, digits and single `_`, such as \"gyro_a\"";

/// Why a name cannot be the prefix of emitted code, if it cannot.
pub fn unfit(name: &str) -> Option<&'static str> {
    let is_letter = |b: u8| b.is_ascii_alphanumeric() || b == b'_';
    if name.is_empty() {
        Some("is empty")
    } else if name.len() > 63 {
        Some("has more than 63 characters")
    } else if name.starts_with('_') {
        Some("begins with an underscore, which C reserves")
    } else if KEYWORDS.contains(&format!(" {name} ")) {
        Some("is a keyword of C, C++ or Rust")
    } else if TAKEN.contains(&format!(" {name} ")) {
        Some("is the name of a standard type or crate")
    } else if name.starts_with(|c: char| c.is_ascii_digit()) || !name.bytes().all(is_letter) {
        Some("is no C identifier")
    } else if name.bytes().any(|b| b.is_ascii_uppercase()) {
        Some("has capitals, and the name of a crate in Rust has none")
    } else if name.contains("__") {
        Some("has two underscores in a row, which C++ reserves")
    } else if name.ends_with('_') {
        Some("ends with an underscore")
    } else {
        None
    }
}

/// Reads `[gyro]`.
pub(super) fn gyro(t: &Table, base: Option<&Gyro>) -> Result<Gyro> {
    let real = |key, from: fn(&Gyro) -> f64, accepted, meaning| {
        t.take(key, base.map(from), |v| v.real(accepted, meaning))
    };
    Ok(Gyro {
        drive_frequency_hz: real(
            "drive_frequency_hz",
            |g| g.drive_frequency_hz,
            Real::Positive,
            "the drive mode's resonance in Hz",
        )?,
        drive_q: real(
            "drive_q",
            |g| g.drive_q,
            Real::Positive,
            "the drive mode's quality factor",
        )?,
        sense_frequency_hz: real(
            "sense_frequency_hz",
            |g| g.sense_frequency_hz,
            Real::Positive,
            "the sense mode's resonance in Hz",
        )?,
        sense_q: real(
            "sense_q",
            |g| g.sense_q,
            Real::Positive,
            "the sense mode's quality factor",
        )?,
        reference_temperature_k: real(
            "reference_temperature_k",
            |g| g.reference_temperature_k,
            Real::Positive,
            "T0 in kelvin, 300 is a warm room",
        )?,
        stiffness_tempco_per_k: real(
            "stiffness_tempco_per_k",
            |g| g.stiffness_tempco_per_k,
            Real::Within(-1e-3, 1e-3),
            "the stiffness's relative fall in 1/K; 49.39 ppm/K is 4.939e-5",
        )?,
        stiffness_law: t.take("stiffness_law", base.map(|g| g.stiffness_law), |v| {
            v.choice(&[
                ("linear", StiffnessLaw::Linear),
                ("square_root", StiffnessLaw::SquareRoot),
            ])
        })?,
        demodulation_error_rad: real(
            "demodulation_error_rad",
            |g| g.demodulation_error_rad,
            Real::Within(-1.2, 1.2),
            "radians between the demodulation and the rate at T0",
        )?,
        bias_dps: bias(&t.section("bias")?, base)?,
        electronics: electronics(&t.section("electronics")?, base)?,
        thermal: thermal(&t.section("thermal")?, base)?,
        effects: effects::read(t, base.map(|g| &g.effects))?,
    })
}

fn bias(t: &Table, base: Option<&Gyro>) -> Result<[f64; 3]> {
    let term = |key, order: usize, meaning| {
        t.take(key, base.map(|g| g.bias_dps[order]), |v| {
            v.real(Real::Any, meaning)
        })
    };
    Ok([
        term("offset_dps", 0, "the bias at phase 0 in deg/s")?,
        term("linear_dps_per_rad", 1, "the bias's slope in deg/s/rad")?,
        term(
            "quadratic_dps_per_rad2",
            2,
            "the bias's curvature in deg/s/rad^2",
        )?,
    ])
}

fn electronics(t: &Table, base: Option<&Gyro>) -> Result<ElectronicsPhase> {
    let base = base.map(|g| &g.electronics);
    Ok(ElectronicsPhase {
        phase_offset_rad: t.take("phase_offset_rad", base.map(|e| e.phase_offset_rad), |v| {
            v.real(Real::Any, "radians at the reference temperature")
        })?,
        phase_slope_rad_per_k: t.take(
            "phase_slope_rad_per_k",
            base.map(|e| e.phase_slope_rad_per_k),
            |v| v.real(Real::Any, "radians per kelvin"),
        )?,
        reference_temperature_degc: t.take(
            "reference_temperature_degc",
            base.map(|e| e.reference_temperature_degc),
            |v| v.real(Real::Celsius, "degrees Celsius"),
        )?,
        loop_share: t.take("loop_share", base.map(|e| e.loop_share), |v| {
            v.real(
                Real::Within(0.0, 1.0),
                "the share of this phase that a phase loop sees",
            )
        })?,
    })
}

fn thermal(t: &Table, base: Option<&Gyro>) -> Result<ThermalNetwork> {
    let base = base.map(|g| &g.thermal);
    let real = |key, from: fn(&ThermalNetwork) -> f64, accepted, meaning| {
        t.take(key, base.map(from), |v| v.real(accepted, meaning))
    };
    Ok(ThermalNetwork {
        structure_heat_j_per_k: real(
            "structure_heat_j_per_k",
            |n| n.structure_heat_j_per_k,
            Real::Positive,
            "the structure's heat capacity in J/K",
        )?,
        structure_chamber_w_per_k: real(
            "structure_chamber_w_per_k",
            |n| n.structure_chamber_w_per_k,
            Real::Positive,
            "the heat flow from structure to chamber in W/K",
        )?,
        electronics_heat_j_per_k: real(
            "electronics_heat_j_per_k",
            |n| n.electronics_heat_j_per_k,
            Real::Positive,
            "the electronics' heat capacity in J/K",
        )?,
        electronics_chamber_w_per_k: real(
            "electronics_chamber_w_per_k",
            |n| n.electronics_chamber_w_per_k,
            Real::Positive,
            "the heat flow from electronics to chamber in W/K",
        )?,
        exchange_w_per_k: real(
            "exchange_w_per_k",
            |n| n.exchange_w_per_k,
            Real::NotNegative,
            "the heat flow from structure to electronics in W/K",
        )?,
        power_w: real(
            "power_w",
            |n| n.power_w,
            Real::NotNegative,
            "the electronics' heat in W",
        )?,
    })
}

/// The most dwells that a thermal run may have in one direction.
const MOST_DWELLS: f64 = 10_000.0;

/// Reads `[thermal_run]`.
pub(super) fn thermal_run(t: &Table, base: Option<&ThermalRun>) -> Result<ThermalRun> {
    let real = |key, from: fn(&ThermalRun) -> f64, accepted, meaning| {
        t.take(key, base.map(from), |v| v.real(accepted, meaning))
    };
    let count = |key, from: fn(&ThermalRun) -> u32, most, meaning| {
        t.take(key, base.map(from), |v| v.integer(1..=most, meaning))
    };
    let run = ThermalRun {
        start_degc: real(
            "start_degc",
            |r| r.start_degc,
            Real::Celsius,
            "where the chamber starts and ends, degC",
        )?,
        stop_degc: real(
            "stop_degc",
            |r| r.stop_degc,
            Real::Celsius,
            "where the chamber turns, degC, above start_degc",
        )?,
        step_k: real(
            "step_k",
            |r| r.step_k,
            Real::Positive,
            "the distance of two dwells in K",
        )?,
        ramp_k_per_min: real(
            "ramp_k_per_min",
            |r| r.ramp_k_per_min,
            Real::Positive,
            "the chamber's ramp between dwells in K/min",
        )?,
        dwell_s: real(
            "dwell_s",
            |r| r.dwell_s,
            Real::NotNegative,
            "the wait before a dwell's readings in s",
        )?,
        readings_per_dwell: count(
            "readings_per_dwell",
            |r| r.readings_per_dwell,
            10_000,
            "readings at each dwell",
        )?,
        samples_per_reading: count(
            "samples_per_reading",
            |r| r.samples_per_reading,
            10_000_000,
            "decimated samples averaged into a reading",
        )?,
        drive_amplitude: t.take("drive_amplitude", base.map(|r| r.drive_amplitude), |v| {
            v.real(
                Real::Within(1e-6, 1.0),
                "the drive's amplitude as a fraction of the ADC's full scale",
            )
        })?,
        sense_full_scale_dps: real(
            "sense_full_scale_dps",
            |r| r.sense_full_scale_dps,
            Real::Positive,
            "the rate that fills the sense ADC in deg/s",
        )?,
        quadrature_dps: real(
            "quadrature_dps",
            |r| r.quadrature_dps,
            Real::Any,
            "the standing quadrature in deg/s",
        )?,
        adc_noise_lsb: real(
            "adc_noise_lsb",
            |r| r.adc_noise_lsb,
            Real::NotNegative,
            "the ADC's input noise in LSB rms",
        )?,
        rate_noise_dps_rthz: real(
            "rate_noise_dps_rthz",
            |r| r.rate_noise_dps_rthz,
            Real::NotNegative,
            "the white rate noise in deg/s/sqrt(Hz)",
        )?,
        flicker_dph: real(
            "flicker_dph",
            |r| r.flicker_dph,
            Real::NotNegative,
            "the bias instability in deg/h",
        )?,
        rate_random_walk_dph_rth: real(
            "rate_random_walk_dph_rth",
            |r| r.rate_random_walk_dph_rth,
            Real::NotNegative,
            "the rate random walk in deg/h/sqrt(h)",
        )?,
        scale_rate_dps: real(
            "scale_rate_dps",
            |r| r.scale_rate_dps,
            Real::Positive,
            "the table's rate for the scale factor in deg/s",
        )?,
        seed: t.take("seed", base.map(|r| r.seed), |v| {
            v.integer(0..=i128::from(u64::MAX), "the seed of all noise")
        })?,
    };
    check_span(t, &run)?;
    Ok(run)
}

/// Refuses a chamber that does not rise, or that rises in too many steps.
fn check_span(t: &Table, run: &ThermalRun) -> Result<()> {
    let span = run.stop_degc - run.start_degc;
    let at = |keys: [&str; 2]| keys.iter().find_map(|key| t.get(key));
    if span <= 0.0 {
        let message = format!(
            "gives a run from start_degc = {} to stop_degc = {}, which does not rise",
            run.start_degc, run.stop_degc
        );
        let e = match at(["stop_degc", "start_degc"]) {
            Some(value) => value.error(message),
            None => t.error(format!("`[thermal_run]` {message}")),
        };
        return Err(e
            .help("give both, `stop_degc` above `start_degc`: the run comes back by itself")
            .into());
    }
    if run.step_k > span || span / run.step_k > MOST_DWELLS {
        let message = format!(
            "gives steps of {} K over {span} K; a run takes 1 to {MOST_DWELLS} steps",
            run.step_k
        );
        let e = match at(["step_k", "stop_degc"]).or_else(|| t.get("start_degc")) {
            Some(value) => value.error(message),
            None => t.error(format!("`[thermal_run]` {message}")),
        };
        return Err(e
            .help("choose `step_k` between the span and a ten-thousandth of it")
            .into());
    }
    Ok(())
}

/// Reads `[fit]`.
pub(super) fn fit(t: &Table, base: Option<&FitOptions>) -> Result<FitOptions> {
    Ok(FitOptions {
        order: t.take("order", base.map(|f| f.order), |v| {
            if v.is_text() && v.text("auto")?.trim().parse::<i64>().is_err() {
                return v.choice(&[("auto", FitOrder::Auto), ("by_record", FitOrder::ByRecord)]);
            }
            let order = v.integer(0..=8, "the polynomial's order, \"auto\" or \"by_record\"")?;
            Ok(FitOrder::Fixed(order))
        })?,
        heldout_blocks: t.take("heldout_blocks", base.map(|f| f.heldout_blocks), |v| {
            v.integer(2..=50, "the blocks of the cross-validation")
        })?,
    })
}
