//! The suite that third-party appendages must pass, advice included, over random pendulums.

use crate::common::{pendulum, ports::shared, rng};
use validate::check_appendage;

#[test]
fn random_pendulums_keep_every_law() {
    let mut r = rng(30);
    for _ in 0..20 {
        let report = check_appendage(&*shared(&pendulum(&mut r)));
        println!("{report}");
        assert!(report.checks.iter().all(|c| c.pass), "{report}");
    }
}
