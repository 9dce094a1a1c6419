//! Error at the end effector when parameters are wrong: `cargo run --release -p ffid --example 06_validate`.

use ffid::dynamics::SimOptions;
use ffid::dynamics::motion::FnMotion;
use ffid::mission::Leniency;
use ffid::model::Params;
use ffid::validate::{compare, frame_path};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper/flex.toml");
    let system = ffid::open::open(file.as_ref(), Leniency::default())?;
    let (model, hold) = (&system.model, system.pose());
    let truth = Params::<f64>::nominal(model);
    // A manoeuvre in joint2 and joint4 for 30 s.
    let motion = FnMotion::new(model.nj(), 30.0, |t, q, qd, qdd| {
        q.copy_from_slice(&hold);
        qd.fill(0.0);
        qdd.fill(0.0);
        for (i, w) in [(1, 0.42), (3, 0.63)] {
            let (sin, cos) = (w * t).sin_cos();
            (q[i], qd[i], qdd[i]) = (q[i] + 0.2 * (1.0 - cos), 0.2 * w * sin, 0.2 * w * w * cos);
        }
    })?;
    let options = SimOptions { duration_s: 30.0, step_s: 5e-3, sample_s: 0.05 };
    let path = |params: &Params<f64>| frame_path(model, params, &motion, "tool", &options);
    let reference = path(&truth)?;
    println!("{:38} {:>10} {:>10} {:>12}", "wrong parameter", "mean (mm)", "max (mm)", "max (mrad)");
    for (pattern, factor) in
        [("base.mass", 1.1), ("base.i_*", 1.1), ("panel_*.k[*]", 1.1), ("panel_*.seg[*].mass", 1.1)]
    {
        let mut wrong = truth.values().to_vec();
        let matching = model.parameter_indices(pattern)?;
        matching.iter().for_each(|&i| wrong[i] *= factor);
        let e = compare(&path(&Params::from_values(model, wrong))?, &reference)?;
        let (mean, max, angle) = (1e3 * e.mean_pos_m, 1e3 * e.max_pos_m, 1e3 * e.max_angle_rad);
        println!("{:38} {mean:10.4} {max:10.4} {angle:12.4}", format!("{pattern} +10 % ({} of them)", matching.len()));
    }
    Ok(())
}
