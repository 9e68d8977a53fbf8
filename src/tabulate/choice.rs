//! Forms that meet a bound, and the cheapest of them.

use super::coefficients::Degree;
use super::describe;
use super::outcome::Alternative;
use super::priced;
use super::request::{Request, Weight};
use super::shortest::{fewest, polynomial_bits};
use crate::approx::form::generate;
use crate::approx::form::generate::{MOST_BIPARTITE_CODES, MOST_SEGMENTS};
use crate::approx::form::measure::{Effort, Measured, Reference, measure};
use crate::approx::form::polynomial;
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
pub(super) const HIGHEST_DEGREE: usize = 12;
/// Most fraction bits of entries beyond the output's.
pub(super) const GUARD_BITS: u32 = 6;
/// The same for bipartite tables, in the order of trial.
const BIPARTITE_GUARD_BITS: [u32; 2] = [1, 3];
/// Fraction bits fewer than those of the bound with which the search for the shortest words begins.
const FAR_BELOW: f64 = 6.0;
/// Finer coefficients that are tried besides the shortest: they may do with shorter steps.
const FINER: usize = 2;
/// More fraction bits than any word has.
const WIDEST_BITS: u32 = 64;
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
    let search = Search::new(function, codes, request, bound);
    if wanted.polynomial {
        found.extend(polynomials(&search, request));
    }
    if wanted.table {
        let kinds = kinds(request.degree).into_iter();
        found.extend(kinds.filter_map(|kind| search.table(kind)));
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

/// The kinds of tables that a degree means.
pub(super) fn kinds(degree: Option<usize>) -> Vec<Kind> {
    match degree {
        Some(0) => vec![Kind::Plain],
        Some(1) => vec![Kind::Linear],
        Some(_) => vec![Kind::Quadratic],
        None => vec![Kind::Plain, Kind::Linear, Kind::Quadratic],
    }
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
        let degrees = degrees.clone().filter(|d| has_degree(kind, *d));
        { degrees }.find_map(|degree| {
            let degree = Degree::new(search.function, request, kind, degree)?;
            search.polynomial(&degree, request)
        })
    };
    kinds.into_iter().filter_map(smallest).collect()
}

/// Odd and even polynomials have a highest order of their kind.
pub(super) fn has_degree(kind: Monomials, degree: usize) -> bool {
    kind == Monomials::All || degree % 2 == usize::from(kind == Monomials::Odd)
}

/// What all searches have in common.
pub(super) struct Search<'a> {
    function: &'a Function,
    codes: Codes,
    output: Format,
    fraction_bits: Option<u32>,
    pub(super) symmetry: Option<Symmetry>,
    target: Target,
    bound: f64,
}

impl<'a> Search<'a> {
    pub(super) fn new(function: &'a Function, codes: Codes, request: &Request, bound: f64) -> Self {
        Search {
            function,
            codes,
            output: request.output,
            fraction_bits: request.coefficients.first().map(|f| f.fraction_bits),
            symmetry: generate::symmetry(function, codes),
            target: request.target,
            bound,
        }
    }

    /// Most fraction bits of coefficients or entries, so many beyond the output's if none are given.
    pub(super) fn most(&self, beyond: u32) -> u32 {
        self.fraction_bits
            .unwrap_or(self.output.fraction_bits + beyond)
    }

    /// Where to begin to look for fraction bits: with fewer, half an LSB is far above the bound.
    fn least(&self) -> u32 {
        let bits = (-self.bound.log2()).ceil() - FAR_BELOW;
        bits.clamp(0.0, f64::from(WIDEST_BITS)) as u32
    }

    /// `finest` with the fewest fraction bits, of those below `most`, that keep to the bound.
    fn shortest(
        &self,
        finest: Candidate,
        most: u32,
        make: &dyn Fn(u32) -> Option<Form>,
    ) -> Candidate {
        if self.fraction_bits.is_some() {
            return finest;
        }
        let at = |bits: u32| self.meets(make(bits));
        fewest(self.least(), most, &at).map_or(finest, |(_, candidate)| candidate)
    }

    /// The polynomial of a degree with the shortest words: of the shortest coefficients and some finer ones, each with the
    /// shortest steps, the cheapest; of equals the one with fewer bits.
    fn polynomial(&self, degree: &Degree, request: &Request) -> Option<Candidate> {
        let room = match request.weight {
            Weight::Absolute => self.bound - 0.5 * self.output.lsb(),
            // Errors are in parts of the function there.
            Weight::Relative => f64::INFINITY,
        };
        if degree.least_error() >= room {
            return None;
        }
        let at = |bits: u32| {
            let ideal = degree.within(bits, room)?;
            let form = degree.evaluation(self.codes, ideal)?;
            self.meets(Some(Form::Polynomial(Box::new(form))))
        };
        let most = degree.most_fraction_bits();
        let finest = at(most)?;
        let mut found = match self.fraction_bits {
            Some(_) => vec![finest],
            None => {
                let (bits, one) = fewest(self.least(), most, &at).unwrap_or((most, finest));
                let finer = (bits + 1..=most).take(FINER).filter_map(at);
                [one].into_iter().chain(finer).collect()
            }
        };
        if request.intermediate.is_none() {
            found = found.into_iter().map(|c| self.short_steps(c)).collect();
        }
        { found.into_iter() }.min_by_key(|c| (c.cost.price(), polynomial_bits(&c.settled.form)))
    }

    /// The same polynomial with steps rounded to as few fraction bits as keep to the bound.
    fn short_steps(&self, finest: Candidate) -> Candidate {
        let Form::Polynomial(p) = &finest.settled.form else {
            return finest;
        };
        let p = p.as_ref();
        let at = |bits: u32| {
            let form = polynomial::rounded_to(p, bits as i32)?;
            self.meets(Some(Form::Polynomial(Box::new(form))))
        };
        let widest = p.formats.intermediate.fraction_bits.max(0) as u32;
        let shorter = fewest(self.least(), widest, &at);
        shorter.map_or_else(|| finest.clone(), |(_, candidate)| candidate)
    }

    /// Logarithm of the number of codes, up to which segments can grow.
    pub(super) fn width(&self) -> u32 {
        128 - (self.codes.count() - 1).leading_zeros()
    }

    pub(super) fn meets(&self, form: Option<Form>) -> Option<Candidate> {
        Candidate::within(form?, self.function, self.target, self.bound)
    }

    /// The longest segments that meet the bound, with the fewest fraction bits that do: errors grow with
    /// the segments' length.
    fn longest(&self, make: &dyn Fn(Split, u32) -> Option<Form>, most: u32) -> Option<Candidate> {
        let best = self.longest_with(make, most)?;
        let Some(split) = best.settled.form.split().cloned() else {
            return Some(best);
        };
        Some(self.shortest(best, most, &|bits| make(split.clone(), bits)))
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
        let most = match kind {
            Kind::Plain => self.most(0),
            _ => self.most(GUARD_BITS),
        };
        let make = |split: Split, fraction_bits| {
            generate::table(self.function, split, kind, self.output, fraction_bits)
        };
        self.longest(&make, most)
    }

    fn uniform(&self, degree: usize) -> Option<Candidate> {
        let make = |split: Split, fraction_bits| {
            generate::piecewise(self.function, split, degree, self.output, fraction_bits)
        };
        self.longest(&make, self.most(GUARD_BITS))
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
            generate::piecewise(f, split, degree, output, fraction_bits)
        };
        let most = self.most(GUARD_BITS);
        let possible = (1..=4u32).filter(|steps| self.width() >= 1 << steps);
        let meets = |k: u32| self.meets(with(k, most)).map(|c| (k, c));
        let (steps, best) = { possible }.find_map(meets)?;
        Some(self.shortest(best, most, &|bits| with(steps, bits)))
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
        let with = |k: usize, fraction_bits: u32| {
            let (_, middle, low) = sizes[k];
            let (f, symmetry, output) = (self.function, self.symmetry, self.output);
            let sizes = (middle, low);
            generate::bipartite(f, self.codes, symmetry, sizes, output, fraction_bits)
        };
        // A bound near half an LSB is out of reach, and small pairs are far from it: bisect first.
        BIPARTITE_GUARD_BITS.into_iter().find_map(|beyond| {
            let most = self.most(beyond);
            let at = |k: usize| self.meets(with(k, most)).map(|c| (k, c));
            let (mut low, mut high) = (0, sizes.len());
            let mut best = None;
            while low < high {
                let k = (low + high) / 2;
                match at(k) {
                    Some(found) => (best, high) = (Some(found), k),
                    None => low = k + 1,
                }
            }
            // Not quite monotone: look a little below.
            let start = high.saturating_sub(PAIRS);
            let (k, finest) = (start..high).find_map(at).or(best)?;
            Some(self.shortest(finest, most, &|bits| with(k, bits)))
        })
    }
}
