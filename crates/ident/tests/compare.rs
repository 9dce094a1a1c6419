//! Which model? Rigid, flexible, sloshing, or both, fitted to the same data and judged by what they predict.

use ff_testkit::assert_within;
use ident::checks::compare::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Residuals of noise plus a slow leftover of some amplitude.
fn candidate(name: &str, estimated: usize, leftover: f64) -> Candidate {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut r = |n: usize| -> Vec<f64> {
        let noise = |i: usize, rng: &mut ChaCha8Rng| {
            let z: f64 = StandardNormal.sample(rng);
            z + leftover * (0.013 * i as f64).sin()
        };
        (0..n).map(|i| noise(i, &mut rng)).collect()
    };
    Candidate { name: name.into(), estimated, training: r(3000), held_out: r(2000) }
}

#[test]
fn the_simplest_of_those_that_predict_alike_is_recommended() {
    let all = [candidate("both", 28, 0.0), candidate("rigid", 10, 0.9), candidate("flexible", 18, 0.01)];
    let c = compare(&all).unwrap();
    assert_eq!((c.recommended.as_str(), c.explains), ("flexible", true));
    assert_eq!(c.candidates[2].name, "rigid");
    assert!(c.reason.contains("as well as both") && c.reason.contains("'rigid', is worse by"), "{}", c.reason);
    let rigid = &c.candidates[2];
    assert!(rigid.aic > 500.0 && rigid.bic > 500.0 && rigid.held_out > 5.0 * rigid.held_out_std, "{rigid:?}");
    // Schwarz charges eight more unknowns more than Akaike does: 8 (ln 3000 - 2).
    let (a, b) = (&c.candidates[0], &c.candidates[1]);
    let (more, less) = if a.estimated > b.estimated { (a, b) } else { (b, a) };
    let charged = (more.bic - less.bic) - (more.aic - less.aic);
    assert_within!((charged - 10.0 * (3000f64.ln() - 2.0)).abs(), 1e-9, "{charged}");
}

#[test]
fn a_best_that_does_not_explain_says_so() {
    let c = compare(&[candidate("rigid", 10, 0.9), candidate("rigid with payload", 20, 0.7)]).unwrap();
    assert_eq!(c.recommended, "rigid with payload");
    assert!(!c.explains && c.reason.contains("something is missing"), "{}", c.reason);
}

#[test]
fn what_cannot_be_compared_is_refused() {
    assert_eq!(compare(&[]), Err(CompareError::None));
    let mut short = candidate("b", 3, 0.0);
    short.held_out.truncate(1999);
    assert!(matches!(compare(&[candidate("a", 3, 0.0), short]), Err(CompareError::Length { record: "held-out", .. })));
    let mut few = candidate("a", 3, 0.0);
    few.held_out.truncate(100);
    assert_eq!(compare(&[few]), Err(CompareError::TooShort(100)));
    let mut bad = candidate("a", 3, 0.0);
    bad.training[4] = f64::INFINITY;
    assert_eq!(compare(&[bad]), Err(CompareError::NotFinite("a".into())));
}
