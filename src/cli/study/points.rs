//! The table of a study's points: what each adds, what it costs, and the marks of its values.

use crate::cost::Cost;
use crate::design::LimitName;
use crate::study::answer::cost_of;
use crate::study::outcome::{Chosen, Point, Study};
use crate::text::number;

/// The columns of figures: title and unit.
const COLUMNS: [&str; 5] = [
    "bias\ndeg/s",
    "drift\ndeg/s",
    "noise\ndeg/s/rtHz",
    "SF\nppm",
    "spur\ndeg/s",
];

/// What the table's marks are of.
pub(super) struct Marks<'a> {
    /// The limits of bytes and cycles that are required.
    costs: Vec<(LimitName, f64)>,
    /// The limits of the columns of figures, in their order, where something is required; without requirements the merit says enough.
    figures: [Option<f64>; COLUMNS.len()],
    /// The points that are chosen.
    chosen: &'a [Chosen],
}

impl Marks<'_> {
    /// Of a study.
    pub(super) fn of(s: &Study) -> Marks<'_> {
        let costs = [LimitName::RomBytes, LimitName::CyclesPerRow].into_iter();
        let limit = |name: LimitName| s.required.iter().find(|r| r.name == name.name());
        Marks {
            costs: costs
                .filter_map(|name| Some((name, limit(name)?.limit)))
                .collect(),
            figures: match s.required.is_empty() {
                true => [None; COLUMNS.len()],
                false => s.limits.limits().map(|(_, limit)| limit),
            },
            chosen: &s.chosen,
        }
    }

    /// What the mark of a value beyond its limit says; `None` where no value can be.
    pub(super) fn beyond(&self) -> Option<String> {
        let costs = self.costs.iter();
        let costs: Vec<String> = costs
            .map(|(name, limit)| format!("{} {limit}", name.name()))
            .collect();
        let of_costs = format!(
            "before a target's cost: the point is beyond {} there",
            costs.join(" or ")
        );
        let of_figures = "before a figure: it is beyond its limit";
        match (self.figures.iter().any(Option::is_some), costs.is_empty()) {
            (true, true) => Some(format!("! {of_figures}")),
            (true, false) => Some(format!("! {of_figures}; {of_costs}")),
            (false, false) => Some(format!("! {of_costs}")),
            (false, true) => None,
        }
    }

    /// Before a point's cost on a target: beyond a limit there, chosen for it, on its front.
    fn of_cost(&self, p: &Point, target: &str) -> String {
        let is_beyond = |cost: &Cost| {
            let mut limits = self.costs.iter();
            limits.any(|(name, limit)| {
                cost_of(cost, target == "fpga", *name).is_some_and(|value| value > *limit)
            })
        };
        let mut chosen = self.chosen.iter().filter(|c| c.target == target);
        let marks = [
            (p.cost.get(target).is_some_and(is_beyond), '!'),
            (chosen.any(|c| c.point == Some(p.number)), '>'),
            (p.targets.iter().any(|t| t == target), '*'),
        ];
        marks.iter().filter(|m| m.0).map(|m| m.1).collect()
    }
}

/// The points and what a merit of 1 is.
pub(super) fn points(s: &Study) -> comfy_table::Table {
    let targets: Vec<String> = s.reference.price.keys().cloned().collect();
    let prices: Vec<String> = targets.iter().map(|t| format!("{t}\n%")).collect();
    let mut header = vec!["point"];
    header.extend(prices.iter().map(String::as_str));
    header.extend(COLUMNS);
    header.extend(["merit", "by"]);
    let mut table = crate::cli::terminal::table(&header);
    let marks = Marks::of(s);
    for p in all_points(s) {
        let mut row = row(p, &targets, &marks);
        if s.chosen.iter().any(|c| c.nearest == Some(p.number)) {
            row[0].insert(0, '!');
        }
        table.add_row(row);
    }
    let limits = s.limits.limits().into_iter();
    let limits = limits.map(|(_, limit)| limit.map_or("-".to_owned(), |l| number(l, 3)));
    let blank = targets.iter().map(|_| String::new());
    let mut limit = vec!["limit".to_owned()];
    limit.extend(blank.chain(limits).chain(["1".to_owned()]));
    table.add_row(limit);
    crate::cli::terminal::numbers(&mut table, 1..1 + targets.len() + COLUMNS.len() + 1);
    // With a mark before each value the table is to be no wider than 100.
    for column in table.column_iter_mut().skip(1) {
        column.set_padding((0, 1));
    }
    table
}

/// The given design, the front, and what is beside it.
pub(super) fn all_points(s: &Study) -> impl Iterator<Item = &Point> {
    std::iter::once(&s.reference)
        .chain(&s.front)
        .chain(&s.nearest)
}

/// A merit of at most 1 does not say by itself that a point may be chosen.
pub(super) fn is_within_by_estimate_alone(p: &Point) -> bool {
    p.merit <= 1.0 && !p.shown
}

fn row(p: &Point, targets: &[String], marks: &Marks) -> Vec<String> {
    let mut row = vec![if p.number == 0 {
        "given".to_owned()
    } else {
        p.number.to_string()
    }];
    for target in targets {
        let part = p.price_of_given.get(target).copied().unwrap_or(f64::NAN);
        row.push(format!("{}{:.1}", marks.of_cost(p, target), 100.0 * part));
    }
    let figures = [
        (p.bias_error_dps, number(p.bias_error_dps, 3)),
        (p.drift_residual_dps, number(p.drift_residual_dps, 3)),
        (p.noise_dps_rthz, number(p.noise_dps_rthz, 3)),
        (p.scale_factor_ppm, format!("{:.1}", p.scale_factor_ppm)),
        (p.spur_dps, number(p.spur_dps, 3)),
    ];
    row.extend(
        figures
            .into_iter()
            .zip(marks.figures)
            .map(|((value, text), limit)| {
                let mark = if limit.is_some_and(|l| value.abs() > l) {
                    "!"
                } else {
                    ""
                };
                format!("{mark}{text}")
            }),
    );
    row.extend([
        // A column of its own would make the table wider than 100.
        match is_within_by_estimate_alone(p) {
            true => format!("?{:.3}", p.merit),
            false => format!("{:.3}", p.merit),
        },
        // Its column.
        match p.limited_by.split('_').next() {
            Some("scale") => "SF",
            name => name.unwrap_or_default(),
        }
        .to_owned(),
    ]);
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::target::Target;
    use crate::study::outcome::WordLengths;

    fn point() -> Point {
        Point {
            number: 4,
            design: None,
            targets: vec!["fpga".to_owned()],
            word_lengths: WordLengths::new(),
            cost: Default::default(),
            price: Default::default(),
            price_of_given: Default::default(),
            bias_error_dps: 0.0,
            drift_residual_dps: 0.0,
            noise_dps_rthz: 0.0,
            arw_deg_rth: 0.0,
            scale_factor_ppm: 0.0,
            spur_dps: 0.0534,
            spur_hz: 1.0,
            spur_detuned: true,
            spur_floor_dps: 0.0,
            merit: 0.926,
            limited_by: "spur_dps",
            parts: Default::default(),
            bounds: Default::default(),
            as_good_as_given: false,
            shown: false,
            verified: true,
            startup_error_dps: None,
            changes: Default::default(),
            alternatives: Vec::new(),
        }
    }

    fn marks(chosen: &[Chosen]) -> Marks<'_> {
        Marks {
            costs: Vec::new(),
            figures: [None; COLUMNS.len()],
            chosen,
        }
    }

    #[test]
    fn a_merit_within_the_limits_by_the_estimates_alone_is_marked() {
        let mut point = point();
        let told = |p: &Point| row(p, &[], &marks(&[])).split_off(1 + COLUMNS.len());
        assert_eq!(told(&point), ["?0.926", "spur"]);
        assert_eq!(COLUMNS[4], "spur\ndeg/s");
        point.shown = true;
        assert_eq!(told(&point), ["0.926", "spur"]);
        // What is beyond its limits needs no mark.
        (point.shown, point.merit) = (false, 2.81);
        assert_eq!(told(&point), ["2.810", "spur"]);
    }

    #[test]
    fn values_beyond_their_limits_and_the_chosen_points_are_marked() {
        let design = crate::design::reader::parse("", None).unwrap();
        let named = ["cortex-m4", "fpga"].map(str::to_owned);
        let target = Target::of_name("cortex-m4").unwrap();
        let cost = crate::cost::of_design(&design, target);
        let mut point = point();
        for name in &named {
            point.cost.insert(name.clone(), cost);
            point.price_of_given.insert(name.clone(), 0.5);
        }
        point.targets = vec!["fpga".to_owned()];
        let chosen = [Chosen {
            target: "fpga".to_owned(),
            point: Some(point.number),
            nearest: None,
            reason: String::new(),
            sensitivity: Vec::new(),
        }];
        let mut marks = marks(&chosen);
        assert_eq!(row(&point, &named, &marks)[1..3], ["50.0", ">*50.0"]);
        assert_eq!(marks.beyond(), None);
        // An FPGA has no cycles of a processor.
        marks.costs = vec![(LimitName::CyclesPerRow, cost.cycles_per_row as f64 - 1.0)];
        assert_eq!(row(&point, &named, &marks)[1..3], ["!50.0", ">*50.0"]);
        let told = marks.beyond().unwrap();
        assert!(
            told.starts_with("! before a target's cost: the point is beyond cycles_per_row "),
            "{told}"
        );
        marks.costs = vec![(LimitName::CyclesPerRow, cost.cycles_per_row as f64)];
        // At the limit is not beyond it.
        assert_eq!(row(&point, &named, &marks)[1], "50.0");
        point.bias_error_dps = -0.02;
        marks.figures = [Some(0.01), None, None, None, Some(0.0534)];
        let figures = row(&point, &named, &marks).split_off(3);
        assert_eq!([&figures[0], &figures[4]], ["!-0.0200", "0.0534"]);
        assert!(
            marks
                .beyond()
                .unwrap()
                .starts_with("! before a figure: it is beyond its limit; ")
        );
    }
}
