//! Forms that meet a bound, and the cheapest of them.

use super::coefficients;
use super::describe;
use super::outcome::Alternative;
use super::priced;
use super::request::Request;
use crate::approx::form::generate;
use crate::approx::form::generate::{MOST_BIPARTITE_CODES, MOST_SEGMENTS};
use crate::approx::form::measure::{Effort, Measured, Reference, measure};
use crate::approx::form::polynomial::Monomials;
use crate::approx::form::split::{Spacing, Split, Symmetry};
use crate::approx::form::table::Kind;
use crate::approx::form::{Codes, Form, Settled};
use crate::approx::reference::Function;
use crate::cost::function::FunctionCost;
use crate::design::target::Target;
use crate::error::Result;
use crate::numeric::format::Format;

/// Codes that are run for each candidate; beyond them its bound comes from analysis.
const QUICK_CODES: u128 = 1 << 16;
/// Of these so many, which only show an error of the proof.
const QUICK_SAMPLE: u128 = 1 << 12;
/// Codes of a first look at a candidate.
const FIRST_LOOK: u128 = 2000;
/// The highest degree of a polynomial that is looked for.
const HIGHEST_DEGREE: usize = 12;
/// Fraction bits of entries beyond the output's.
const GUARD_BITS: [u32; 4] = [1, 2, 3, 6];
/// Pairs of sizes that are tried for a bipartite table.
const PAIRS: usize = 12;

/// A form with its measured error and cost.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// In words.
    pub detail: String,
    /// The form.
    pub settled: Settled,
    /// Its error.
    pub measured: Measured,
    /// Its cost.
    pub cost: FunctionCost,
}

impl Candidate {
    /// Settles and measures a form without running more codes than a search can afford; `None` if
    /// it does not keep to the bound.
    pub fn within(
        form: Form,
        reference: &dyn Reference,
        target: Target,
        bound: f64,
    ) -> Option<Candidate> {
        let settled = form.settle().ok()?;
        if !keeps_to(&settled, reference, bound) {
            return None;
        }
        let measured = quick(&settled, reference).ok()?;
        (measured.certified <= bound).then(|| Candidate {
            detail: describe::detail(&settled.form),
            cost: priced::cost(&settled, target),
            measured,
            settled,
        })
    }

    /// As a line of the list, not yet judged among the others.
    pub fn listed(&self) -> Alternative {
        Alternative {
            form: self.settled.form.name(),
            detail: self.detail.clone(),
            cost: self.cost,
            certified_max_abs: self.measured.certified,
            undominated: false,
            chosen: false,
        }
    }
}

impl Alternative {
    /// In ROM, multiplications, additions and error.
    fn dominates(&self, other: &Alternative) -> bool {
        let (a, b) = (&self.cost, &other.cost);
        let (x, y) = (self.certified_max_abs, other.certified_max_abs);
        let no_worse = a.rom_bytes <= b.rom_bytes
            && a.multiplies <= b.multiplies
            && a.adds <= b.adds
            && x <= y;
        let better =
            a.rom_bytes < b.rom_bytes || a.multiplies < b.multiplies || a.adds < b.adds || x < y;
        no_worse && better
    }
}

/// A form's error without running more codes than a search can afford: beyond them the bound comes from analysis.
///
/// # Errors
/// A result outside the proved bound: an error of this program.
pub fn quick(settled: &Settled, reference: &dyn Reference) -> Result<Measured> {
    let effort = Effort {
        most_codes: QUICK_CODES,
        sample: QUICK_SAMPLE,
        threads: crate::approx::form::measure::threads(),
        progress: &|_| (),
    };
    measure(settled, reference, &effort)
}

/// Quickly: whether some codes keep to the bound. Most candidates do not.
fn keeps_to(settled: &Settled, reference: &dyn Reference, bound: f64) -> bool {
    let codes = settled.form.codes();
    let lsb = settled.form.output().lsb();
    // A step that meets every place in segments of 2^k codes.
    let step = (codes.count() / FIRST_LOOK) as usize | 1;
    (codes.low..=codes.high).step_by(step).all(|code| {
        let (value, radius) = reference.at(codes.real(code));
        (settled.run(code) as f64 * lsb - value).abs() <= bound + radius
    })
}

/// Which forms are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted {
    /// Polynomials.
    pub polynomial: bool,
    /// Tables.
    pub table: bool,
    /// Piecewise polynomials.
    pub piecewise: bool,
}

/// One candidate of each kind that meets the bound: the smallest of its kind.
///
/// # Errors
/// A coefficient format that a coefficient exceeds, where that is what stands in the way.
pub fn candidates(
    function: &Function,
    codes: Codes,
    request: &Request,
    bound: f64,
    wanted: Wanted,
) -> Result<Vec<Candidate>> {
    let mut found = Vec::new();
    let search = Search {
        function,
        codes,
        output: request.output,
        fraction_bits: request.coefficients.first().map(|f| f.fraction_bits),
        symmetry: generate::symmetry(function, codes),
        target: request.target,
        bound,
    };
    if wanted.polynomial {
        found.extend(polynomials(&search, request));
    }
    if wanted.table {
        let kinds = match request.degree {
            Some(0) => vec![Kind::Plain],
            Some(1) => vec![Kind::Linear],
            Some(_) => vec![Kind::Quadratic],
            None => vec![Kind::Plain, Kind::Linear, Kind::Quadratic],
        };
        found.extend(kinds.into_iter().filter_map(|kind| search.table(kind)));
        if request.degree.is_none_or(|d| d == 0) {
            found.extend(search.bipartite());
        }
    }
    if wanted.piecewise {
        for degree in 1..=crate::approx::form::piecewise::HIGHEST_DEGREE {
            if request.degree.is_none_or(|d| d == degree) {
                found.extend(search.uniform(degree));
                found.extend(search.power_of_two(degree));
            }
        }
    }
    Ok(found)
}

/// The cheapest on the target.
pub fn cheapest(candidates: &[Candidate]) -> Option<usize> {
    (0..candidates.len()).min_by_key(|k| candidates[*k].cost.price())
}

/// The list for the report.
pub fn alternatives(candidates: &[Candidate], chosen: usize) -> Vec<Alternative> {
    judged(candidates.iter().map(Candidate::listed).collect(), chosen)
}

/// The list with the undominated ones and the chosen one marked.
pub fn judged(mut all: Vec<Alternative>, chosen: usize) -> Vec<Alternative> {
    let free = |one: &Alternative| !all.iter().any(|other| other.dominates(one));
    let undominated: Vec<bool> = all.iter().map(free).collect();
    for ((k, one), undominated) in all.iter_mut().enumerate().zip(undominated) {
        (one.undominated, one.chosen) = (undominated, k == chosen);
    }
    all
}

fn polynomials(search: &Search, request: &Request) -> Vec<Candidate> {
    let kinds = match request.monomials {
        Some(kind) => vec![kind],
        None => vec![Monomials::All, Monomials::Odd, Monomials::Even],
    };
    let degrees = match request.degree {
        Some(degree) => degree..=degree,
        None => 0..=HIGHEST_DEGREE,
    };
    let smallest = |kind: Monomials| {
        degrees.clone().find_map(|degree| {
            if kind != Monomials::All && degree % 2 != usize::from(kind == Monomials::Odd) {
                return None;
            }
            let form = coefficients::polynomial_within(
                search.function,
                search.codes,
                request,
                kind,
                degree,
                search.bound,
            )?;
            Candidate::within(form, search.function, search.target, search.bound)
        })
    };
    kinds.into_iter().filter_map(smallest).collect()
}

/// What all searches have in common.
struct Search<'a> {
    function: &'a Function,
    codes: Codes,
    output: Format,
    fraction_bits: Option<u32>,
    symmetry: Option<Symmetry>,
    target: Target,
    bound: f64,
}

impl Search<'_> {
    fn guards(&self) -> Vec<u32> {
        match self.fraction_bits {
            Some(bits) => vec![bits],
            None => GUARD_BITS.map(|g| self.output.fraction_bits + g).to_vec(),
        }
    }

    /// Logarithm of the number of codes, up to which segments can grow.
    fn width(&self) -> u32 {
        128 - (self.codes.count() - 1).leading_zeros()
    }

    fn meets(&self, form: Option<Form>) -> Option<Candidate> {
        Candidate::within(form?, self.function, self.target, self.bound)
    }

    /// The longest segments that meet the bound, with the fewest fraction bits that do: errors grow with
    /// the segments' length.
    fn longest(
        &self,
        make: &dyn Fn(Split, u32) -> Option<Form>,
        guards: &[u32],
    ) -> Option<Candidate> {
        let (most, fewer) = guards.split_last()?;
        let best = self.longest_with(make, *most)?;
        let Some(split) = best.settled.form.split() else {
            return Some(best);
        };
        let smaller = fewer
            .iter()
            .find_map(|guard| self.meets(make(split.clone(), *guard)));
        Some(smaller.unwrap_or(best))
    }

    fn longest_with(
        &self,
        make: &dyn Fn(Split, u32) -> Option<Form>,
        guard: u32,
    ) -> Option<Candidate> {
        let split = |bits| Split::new(self.codes, self.symmetry, Spacing::Uniform { bits });
        let longest = self.width();
        let most = longest.saturating_sub(MOST_SEGMENTS.ilog2());
        let at = |bits: u32| self.meets(make(split(bits), guard));
        let mut best = None;
        let (mut low, mut high) = (most, longest);
        while low <= high {
            let bits = (low + high) / 2;
            match at(bits) {
                Some(candidate) => {
                    best = Some(candidate);
                    low = bits + 1;
                }
                None if bits == 0 => break,
                None => high = bits - 1,
            }
        }
        best
    }

    fn table(&self, kind: Kind) -> Option<Candidate> {
        let guards = match (kind, self.fraction_bits) {
            (Kind::Plain, None) => vec![self.output.fraction_bits],
            _ => self.guards(),
        };
        let make = |split: Split, fraction_bits| {
            generate::table(self.function, split, kind, self.output, fraction_bits)
        };
        self.longest(&make, &guards)
    }

    fn uniform(&self, degree: usize) -> Option<Candidate> {
        let make = |split: Split, fraction_bits| {
            generate::piecewise(self.function, split, degree, self.output, fraction_bits)
        };
        self.longest(&make, &self.guards())
    }

    /// The code from which power-of-two segments go outward: 0 if that is the middle of a symmetry or an end of
    /// the domain, else the middle of a symmetry or the first code. Seen from the last code downward
    /// everything is the mirror image of what is not there.
    fn outward(&self) -> Option<Symmetry> {
        let from_zero = Symmetry {
            about_raw: 0,
            odd: false,
        };
        match self.symmetry {
            Some(s) if s.about_raw == 0 => Some(s),
            _ if self.codes.low == 0 => None,
            _ if self.codes.high == 0 => Some(from_zero),
            other => other,
        }
    }

    fn power_of_two(&self, degree: usize) -> Option<Candidate> {
        let symmetry = self.outward();
        let with = |steps: u32, fraction_bits: u32| {
            let spacing = Spacing::PowerOfTwo { steps };
            let split = Split::new(self.codes, symmetry, spacing);
            let (f, output) = (self.function, self.output);
            self.meets(generate::piecewise(f, split, degree, output, fraction_bits))
        };
        let guards = self.guards();
        let (most, fewer) = guards.split_last()?;
        let possible = (1..=4u32).filter(|steps| self.width() >= 1 << steps);
        let (steps, best) = { possible }.find_map(|k| with(k, *most).map(|c| (k, c)))?;
        let smaller = fewer.iter().find_map(|guard| with(steps, *guard));
        Some(smaller.unwrap_or(best))
    }

    /// The smallest pair of tables that meets the bound.
    fn bipartite(&self) -> Option<Candidate> {
        if self.codes.count() > MOST_BIPARTITE_CODES {
            return None;
        }
        let width = self.width();
        let mut sizes = Vec::new();
        for low in 1..width {
            for middle in 0..width - low {
                let entries = (1u64 << (width - low)) + (1u64 << (width - middle - 1));
                sizes.push((entries, middle, low));
            }
        }
        sizes.sort_unstable();
        // A bound near half an LSB is out of reach, and small pairs are far from it: bisect first.
        self.guards()
            .into_iter()
            .step_by(2)
            .find_map(|fraction_bits| {
                let at = |k: usize| {
                    let (_, middle, low) = sizes[k];
                    let sizes = (middle, low);
                    let (f, symmetry) = (self.function, self.symmetry);
                    let form = generate::bipartite(
                        f,
                        self.codes,
                        symmetry,
                        sizes,
                        self.output,
                        fraction_bits,
                    );
                    self.meets(form)
                };
                let (mut low, mut high) = (0, sizes.len());
                let mut best = None;
                while low < high {
                    let k = (low + high) / 2;
                    match at(k) {
                        Some(candidate) => (best, high) = (Some(candidate), k),
                        None => low = k + 1,
                    }
                }
                // Not quite monotone: look a little below.
                let start = high.saturating_sub(PAIRS);
                (start..high).find_map(at).or(best)
            })
    }
}
