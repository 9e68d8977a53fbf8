//! How good a design is, as one number: the largest figure in parts of its limit.
//!
//! Where the user requires nothing, a figure counts as 1 where it makes the data sheet's own figure one percent
//! worse than with the given design: bias and drift one percent of the instrument's drift over temperature, noise and
//! lines so much that they add one percent to the instrument's noise (in squares), the scale factor one percent of its
//! change, each beside what the given design's words add themselves.

use super::certainty::{Bounds, Confidence, Errors, FIGURES, largest};
use super::figures::Figures;
use crate::circuit::scale::full_scale_dps;
use crate::design::{Design, LimitName, Limits};
use serde::Serialize;

/// What each figure that words add counts against; infinite = not at all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Scale {
    /// deg/s.
    pub bias_dps: Option<f64>,
    /// deg/s.
    pub drift_dps: Option<f64>,
    /// deg/s/sqrt(Hz).
    pub noise_dps_rthz: Option<f64>,
    /// ppm.
    pub scale_factor_ppm: Option<f64>,
    /// deg/s.
    pub spur_dps: Option<f64>,
}

/// A figure's worsening that counts as 1.
const WORSE: f64 = 0.01;

/// Points that a study is expected to verify: the standard errors of a bound hardly depend on it (convention).
const EXPECTED_POINTS: usize = 64;

/// As [`crate::study::figures::arw_deg_rth`] has it.
const ARW: f64 = 60.0 / std::f64::consts::SQRT_2;

impl Scale {
    /// From the figures of the instrument without quantisation.
    pub fn of_instrument(design: &Design, whole: &Figures, bandwidth_hz: f64) -> Scale {
        // Nothing is finer than a thousandth of the output's LSB, or of a billionth of full scale without one.
        let lsb = design.compensation.as_ref().map(|c| c.output.format.lsb());
        let least = lsb.map_or(1e-9 * full_scale_dps(design), |l| 1e-3 * l);
        let row_hz = design.circuit.sample_rate_hz / f64::from(design.circuit.decimator.ratio);
        let in_squares = ((1.0 + WORSE).powi(2) - 1.0).sqrt();
        let density = whole.noise_dps_rthz.max(least / row_hz.sqrt()) * in_squares;
        let drift = (WORSE * whole.drift_dps).max(least);
        Scale {
            bias_dps: Some(drift),
            drift_dps: Some(drift),
            noise_dps_rthz: Some(density),
            scale_factor_ppm: Some((WORSE * whole.scale_factor_ppm).max(1e-3)),
            spur_dps: Some(density * (2.0 * bandwidth_hz).sqrt()),
        }
    }

    /// With what the given design adds itself: a figure of another design is as good where the whole, instrument and
    /// words, is at most `WORSE` worse than the given design's whole. Bias, drift and scale factor add up, noise and
    /// lines in squares.
    pub fn beside(self, f: &Figures) -> Scale {
        let own = |value: f64| (1.0 + WORSE) * value.abs();
        let sum = |limit: Option<f64>, value: f64| limit.map(|l| l + own(value));
        let square = |limit: Option<f64>, value: f64| limit.map(|l| l.hypot(own(value)));
        Scale {
            bias_dps: sum(self.bias_dps, f.bias_dps),
            drift_dps: sum(self.drift_dps, f.drift_dps),
            noise_dps_rthz: square(self.noise_dps_rthz, f.noise_dps_rthz),
            scale_factor_ppm: sum(self.scale_factor_ppm, f.scale_factor_ppm),
            spur_dps: square(self.spur_dps, f.spur_dps),
        }
    }

    /// From what the user requires; the figures that nobody named do not count.
    pub fn of_limits(limits: &Limits) -> Scale {
        let noise = [
            limits.get(LimitName::Noise),
            limits.get(LimitName::Arw).map(|a| a / ARW),
        ];
        Scale {
            bias_dps: limits.get(LimitName::Bias),
            drift_dps: limits.get(LimitName::Drift),
            noise_dps_rthz: noise.into_iter().flatten().reduce(f64::min),
            scale_factor_ppm: limits.get(LimitName::ScaleFactor),
            spur_dps: limits.get(LimitName::Spur),
        }
    }

    /// With the noise limited to what leaves the verification's intervals room within these limits, of the start from
    /// power-on within its own, `start`: limit and standard error, deg/s.
    ///
    /// A mean is as uncertain as the noise is large. A search for a small bias alone ends at designs that are cheap and
    /// noisy and whose bias is small by chance, of which no run of the verification's length shows anything. How an
    /// interval's width goes with the noise is taken from the given design, `f` and `e`: an estimate, which only steers the
    /// search.
    pub fn that_can_be_shown(self, f: &Figures, e: &Errors, start: [Option<f64>; 2]) -> Scale {
        let [start_dps, start_error] = start;
        let z = Confidence::of(FIGURES * EXPECTED_POINTS).standard_errors;
        let widths = [
            (self.bias_dps, z * e.bias_dps),
            (self.drift_dps, z * e.drift_dps),
            (self.scale_factor_ppm, z * e.scale_factor_ppm),
            (self.spur_dps, f.spur_floor_dps),
            (start_dps, z * start_error.unwrap_or(0.0)),
        ];
        let room = widths
            .into_iter()
            .filter_map(|(limit, width)| Some(limit? / width * f.noise_dps_rthz))
            .filter(|noise| noise.is_finite() && *noise > 0.0);
        Scale {
            noise_dps_rthz: room.chain(self.noise_dps_rthz).reduce(f64::min),
            ..self
        }
    }

    /// True if no figure counts.
    pub fn is_empty(&self) -> bool {
        self.limits().iter().all(|(_, limit)| limit.is_none())
    }

    /// Each figure's name and its part of its limit.
    pub fn parts(&self, f: &Figures) -> [(&'static str, f64); 5] {
        let part = |value: f64, limit: Option<f64>| limit.map_or(0.0, |l| value.abs() / l);
        [
            ("bias_dps", part(f.bias_dps, self.bias_dps)),
            ("drift_dps", part(f.drift_dps, self.drift_dps)),
            (
                "noise_dps_rthz",
                part(f.noise_dps_rthz, self.noise_dps_rthz),
            ),
            (
                "scale_factor_ppm",
                part(f.scale_factor_ppm, self.scale_factor_ppm),
            ),
            ("spur_dps", part(f.spur_dps, self.spur_dps)),
        ]
    }

    /// The largest part: at most 1 = within every limit.
    pub fn merit(&self, f: &Figures) -> f64 {
        self.parts(f)
            .into_iter()
            .map(|(_, p)| p)
            .fold(0.0, f64::max)
    }

    /// True if every figure is within its limit: the whole of its interval, or the figure itself where it is at most
    /// `WORSE` above `given`'s, which has run on the same noise.
    pub fn holds(&self, f: &Figures, bounds: &Bounds, given: &Figures) -> bool {
        let parts = self.parts(f).into_iter().zip(self.parts(given));
        self.limits()
            .into_iter()
            .zip(parts)
            .all(|((name, limit), (own, given))| {
                let most = bounds.of(name).map(largest);
                let within = match (limit, most) {
                    (Some(limit), Some(most)) => most <= limit,
                    _ => true,
                };
                within || own.1 <= (1.0 + WORSE) * given.1
            })
    }

    /// Each figure's limit, in the order of [`parts`](Self::parts).
    pub fn limits(&self) -> [(LimitName, Option<f64>); 5] {
        [
            (LimitName::Bias, self.bias_dps),
            (LimitName::Drift, self.drift_dps),
            (LimitName::Noise, self.noise_dps_rthz),
            (LimitName::ScaleFactor, self.scale_factor_ppm),
            (LimitName::Spur, self.spur_dps),
        ]
    }

    /// The figure with the largest part.
    pub fn worst(&self, f: &Figures) -> &'static str {
        let mut worst = ("bias_dps", f64::NEG_INFINITY);
        for part in self.parts(f) {
            if part.1 > worst.1 {
                worst = part;
            }
        }
        worst.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_on_the_bias_leaves_room_for_as_much_noise_as_its_intervals_allow() {
        let given = Figures {
            noise_dps_rthz: 1e-4,
            ..Figures::default()
        };
        let errors = Errors {
            bias_dps: 1e-4,
            ..Errors::default()
        };
        let bias = Scale::of_limits(&Limits::parse("bias_dps<=0.01").unwrap());
        let z = Confidence::of(FIGURES * EXPECTED_POINTS).standard_errors;
        let noise = |scale: Scale, start| {
            let scale = scale.that_can_be_shown(&given, &errors, start);
            scale.noise_dps_rthz.unwrap()
        };
        let own = noise(bias, [None, None]);
        assert!((own * z / 0.01 - 1.0).abs() < 1e-9, "{own}");
        // The start is the less certain of the two, and counts where the bias has no limit.
        let start = [Some(0.01), Some(4e-4)];
        assert!((noise(bias, start) * 4.0 / own - 1.0).abs() < 1e-9);
        let noisy = Scale::of_limits(&Limits::parse("noise_dps_rthz<=1e-5").unwrap());
        assert_eq!(noise(noisy, start), 1e-5);
        // Without noise there is nothing to go by.
        let silent = bias.that_can_be_shown(&Figures::default(), &Errors::default(), start);
        assert_eq!(silent, bias);
    }
}
