//! Which combinations no record can tell, which this one does not, and what can be estimated instead.

use approx::assert_relative_eq;
use ff_testkit::scaled;
use ident::belief::*;
use nalgebra::DMatrix;

fn unknowns() -> Vec<Unknown> {
    let sizes = [600.0, 0.5, 20.0, 3.0];
    sizes.iter().enumerate().map(|(i, s)| Unknown { name: format!("p{i}"), unit: "kg".into(), size: *s }).collect()
}
/// Column 3 is `0.2 column 1 - 0.05 column 0`; with `still`, column 2 is silent.
fn sensitivities(still: bool) -> DMatrix<f64> {
    let scale = [0.02, 30.0, if still { 0.0 } else { 0.4 }];
    let mut j = DMatrix::from_fn(40, 4, |i, k| {
        scale.get(k).map_or(0.0, |s| s * ((0.31 * (k + 1) as f64) * i as f64 + 0.4).sin())
    });
    let c = j.column(1) * 0.2 - j.column(0) * 0.05;
    j.set_column(3, &c);
    j
}

#[test]
fn what_no_record_tells_is_told_from_what_this_one_does_not() {
    let structure = analyse(&sensitivities(false), &unknowns(), 1e-9).unwrap();
    let record = analyse(&sensitivities(true), &unknowns(), 1e-9).unwrap();
    assert_eq!((structure.rank, record.rank), (3, 2));
    let s = silence(&record, &structure).unwrap();
    assert_eq!((s.structural.len(), s.unexcited.len()), (1, 1));
    assert_eq!(s.unexcited[0].terms, [("p2".to_owned(), 20.0)]);
    let names: Vec<&str> = s.structural[0].terms.iter().map(|t| t.0.as_str()).collect();
    assert!(names.contains(&"p1") && names.contains(&"p3") && !names.contains(&"p2"), "{names:?}");
    assert_eq!(silence(&structure, &structure).unwrap().unexcited, []);
    // Other sizes, and a bias behind the parameters.
    let mut more = sensitivities(true).insert_column(4, 1.0);
    more[(3, 4)] = 2.0;
    let mut names = unknowns();
    names.iter_mut().for_each(|u| u.size *= 1.7);
    names.push(Unknown { name: "bias".into(), unit: "N m".into(), size: 0.1 });
    let s = silence(&analyse(&more, &names, 1e-9).unwrap(), &structure).unwrap();
    assert_eq!((s.structural.len(), s.unexcited.len()), (1, 1));
    assert_eq!(s.unexcited[0].terms[0].0, "p2");
}

#[test]
fn a_reduced_set_predicts_the_same() {
    let j = sensitivities(false);
    let u = analyse(&j, &unknowns(), 1e-9).unwrap();
    let r = reduce(&u).unwrap();
    assert_eq!((r.kept.len(), r.held.len(), r.combinations.len()), (3, 1, 3));
    // Moving the held one is undone by moving the kept ones.
    let mut undone = j.column(r.held[0]).into_owned();
    for (k, c) in r.kept.iter().zip(&r.combinations) {
        assert_eq!(c.name, format!("p{k}"));
        let part = c.terms.iter().find(|t| t.0 == format!("p{}", r.held[0])).map_or(0.0, |t| t.1);
        undone -= j.column(*k) * part;
    }
    assert_relative_eq!(undone.norm(), 0.0, epsilon = scaled(1e-10 * j.column(r.held[0]).norm()));
    // A bias that acts as column 2 does: as nuisance it is kept, and the parameter is held.
    let mut biased = j.clone().insert_column(4, 0.0);
    let twin = biased.column(2) * 1e-3;
    biased.set_column(4, &twin);
    let mut names = unknowns();
    names.push(Unknown { name: "bias".into(), unit: "N m".into(), size: 0.1 });
    let u = analyse(&biased, &names, 1e-9).unwrap();
    let kept = |r: Reduced| (r.kept.contains(&2), r.kept.contains(&4));
    assert_eq!(kept(reduce(&u).unwrap()), (true, false));
    assert_eq!(kept(reduce_parameters(&u, 4).unwrap()), (false, true));
    let all = reduce(&analyse(&j.columns(0, 3).into_owned(), &unknowns()[..3], 1e-9).unwrap()).unwrap();
    assert_eq!((all.kept, all.held.len()), (vec![0, 1, 2], 0));
}
