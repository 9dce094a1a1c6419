//! The boom keeps every law, its factory refuses what it should, and it is as short as the documentation says.

use ff_model::Registry;
use validate::conformance::law;

/// Allocations of one call, by the counting allocator of this test program.
fn meter(f: &mut dyn FnMut()) -> u64 {
    allocation_counter::measure(f).count_total
}

#[test]
fn the_boom_keeps_every_law() {
    let mut registry = Registry::new();
    antenna_boom::register(&mut registry);
    let boom = registry.build(antenna_boom::KIND, registry.examples(antenna_boom::KIND)[0]).unwrap();
    let report = validate::check_appendage_counting(&*boom, meter);
    println!("{report}");
    assert!(report.checks.iter().all(|c| c.pass), "{report}");
    // With its factory, bad tables and whole systems at odd values.
    let report = validate::check_kind(&registry, antenna_boom::KIND, Some(meter));
    println!("{report}");
    assert!(report.checks.iter().all(|c| c.pass), "{report}");
    assert!(report.check(law::TABLES).is_some() && report.check(law::SYSTEM).is_some());
}

/// Lines of the whole crate that are neither blank nor comment, as rustfmt lays them out.
#[test]
fn it_is_under_60_lines_of_code() {
    let code = include_str!("../src/lib.rs").lines().map(str::trim);
    let lines = code.filter(|l| !l.is_empty() && !l.starts_with("//")).count();
    println!("{lines} lines");
    assert!((20..60).contains(&lines), "{lines} lines");
}
