//! The suite that third-party appendages must pass, advice included, over random chains.

use crate::common::{chain, ports::shared, rng};
use validate::check_appendage;

#[test]
fn random_chains_keep_every_law() {
    let mut r = rng(30);
    for n in [1, 2, 3, 4, 6, 9, 16] {
        let report = check_appendage(&*shared(&chain(&mut r, n)));
        println!("{report}");
        assert!(report.checks.iter().all(|c| c.pass), "{n} segments: {report}");
    }
}
