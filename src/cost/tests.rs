use super::fabric::tiles;
use super::function::FunctionCost;
use super::price::{Objective, Weights};
use super::{Cost, Target, of_bundle, of_design};
use crate::design::{Design, reader, template};
use crate::emit::bundle::{Bundle, Part};

fn design(changes: &[(&str, &str)]) -> Design {
    let mut text = template::DEFAULT.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    reader::parse(&text, None).unwrap()
}

fn cost(changes: &[(&str, &str)], target: Target) -> Cost {
    of_design(&design(changes), target)
}

const PRODUCT: &str = "product = { format = \"Q2.22\"";

/// Products of Q2.15 and less make the decimator's sums fit 32 bits: counted by hand in the compiler's assembly,
/// `push` with `sample` in it falls from 102 to 71 instructions on Cortex-M4.
#[test]
fn words_of_32_bits_in_the_decimator_take_fewer_instructions() {
    let at = |format: &str, target| {
        let to = format!("product = {{ format = \"{format}\"");
        cost(&[(PRODUCT, &to)], target)
    };
    for target in Target::ALL {
        let [wide, same, short] =
            ["Q2.22", "Q2.16", "Q2.15"].map(|f| at(f, target).instructions_per_row);
        if target == Target::Host {
            continue;
        }
        // But for the slow part's shifts, and for rounding constants that are no immediates: the model loads them for
        // each of the four products, a compiler once.
        assert!(
            wide.abs_diff(same) * 100 < wide * 4,
            "{target:?}: {wide} {same}"
        );
        assert!(short < wide * 4 / 5, "{target:?}: {short} of {wide}");
    }
}

#[test]
fn the_sample_rate_counts_as_often_as_it_runs() {
    let rows = |ratio: &str| cost(&[("ratio = 32", ratio)], Target::CortexM4);
    let (one, two) = (rows("ratio = 64"), rows("ratio = 128"));
    let sample = (two.instructions_per_row - one.instructions_per_row) as f64 / 64.0;
    // Counted in the compiler's assembly: 102, less the return that is not taken.
    assert!((87.0..113.0).contains(&sample), "{sample}");
    assert_eq!(one.rom_bytes, two.rom_bytes);
}

#[test]
fn cordic_costs_by_its_iterations() {
    let with = |n: &str| cost(&[("iterations = 20", n)], Target::CortexM4);
    let (few, many) = (with("iterations = 10"), with("iterations = 20"));
    let each = (many.instructions_per_row - few.instructions_per_row) as f64 / 10.0;
    // Counted in the compiler's assembly: 16.
    assert!((13.0..19.0).contains(&each), "{each}");
    assert_eq!(few.fabric.multiplier_tiles, many.fabric.multiplier_tiles);
}

#[test]
fn memory_is_that_of_the_types() {
    let c = cost(&[], Target::CortexM4);
    // 4096 sines of 16 bits, 20 angles of 32.
    assert_eq!(c.rom_bytes, 4096 * 2 + 20 * 4);
    // Phase and tuning word, four channels of 3 integrators and 3 delays of 64 bits, the loop's integrator.
    assert_eq!(c.ram_bytes, 8 + 4 * 6 * 8 + 4);
    let wide = cost(
        &[("table = \"Q1.15\"", "table = \"Q1.16\"")],
        Target::CortexM4,
    );
    assert_eq!(wide.rom_bytes, 4096 * 4 + 20 * 4);
    let short = cost(
        &[("table_address_bits = 12", "table_address_bits = 5")],
        Target::CortexM4,
    );
    assert_eq!(short.rom_bytes, 32 * 2 + 20 * 4);
}

/// Published block widths (Xilinx UG479): one DSP48E1 multiplies 25 x 18, two 24 x 24, four 32 x 32.
#[test]
fn tiles_of_products() {
    let known = [
        (16, 16, 1),
        (18, 18, 1),
        (25, 18, 1),
        (18, 25, 1),
        (24, 24, 2),
        (27, 18, 2),
        (32, 32, 4),
    ];
    for (a, b, n) in known {
        assert_eq!(tiles(a, b), n, "{a} x {b}");
    }
}

#[test]
fn an_fpga_counts_exact_bits() {
    let f = cost(&[], Target::Host).fabric;
    // Four mixers, the CORDIC's gain (31 x 25 bits), two of the polynomial.
    assert!(f.multiplier_tiles >= 4 + 2 + 2, "{f:?}");
    // Four channels of three integrators and three combs of 39 bits.
    let decimator = 4 * 6 * 39;
    assert!(
        f.adder_bits > decimator && f.adder_bits < 2 * decimator,
        "{f:?}"
    );
    assert!(f.register_bits >= decimator + 64, "{f:?}");
    // The sine's words take all 16 bits, the angles' 22.
    assert_eq!(f.rom_bits, 4096 * 16 + 20 * 22);
    let narrow = cost(&[(PRODUCT, "product = { format = \"Q2.21\"")], Target::Host).fabric;
    assert!(f.adder_bits - narrow.adder_bits >= 24, "{f:?} {narrow:?}");
}

#[test]
fn a_32_by_32_bit_product_is_one_instruction_on_cortex_m4() {
    let bundle = Bundle::new(&design(&[]), Part::Compensation);
    let on = |target| of_bundle(&bundle, target).cycles_per_row;
    let (m4, fast, slow) = (
        on(Target::CortexM4),
        on(Target::CortexM0Fast),
        on(Target::CortexM0),
    );
    assert!(m4 < 80, "{m4}");
    // Two products by the library, six multiplications each.
    assert_eq!(slow - fast, 2 * 6 * 31);
    assert!(fast > m4);
    let alone = FunctionCost::of_program(&bundle.program, &[], Target::CortexM4);
    assert_eq!((alone.multiplies, alone.adds), (2, 3));
}

#[test]
fn prices_are_weighted_sums() {
    let c = cost(&[], Target::CortexM4);
    let one = Weights {
        adder_bit: 2.0,
        rom_byte: 1.0,
        ..Weights::default()
    };
    let expected = 2.0 * c.fabric.adder_bits as f64 + c.rom_bytes as f64;
    assert_eq!(c.price(&one), expected);
    assert_eq!(Objective::of_name("fpga"), Some(Objective::fabric()));
    for target in Target::ALL {
        let of_name = Objective::of_name(target.name()).map(|o| o.target);
        assert_eq!(of_name, Some(target));
    }
    assert_eq!(
        Objective::of_name("riscv32").map(|o| o.target),
        Some(Target::Rv32imc)
    );
    assert_eq!(Objective::of_name("cortex-m7"), None);
}
