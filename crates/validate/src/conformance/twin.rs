//! The appendage against its twin of ordinary tree links.

use super::derived::matrix;
use super::law;
use super::measure::{Worst, amax, bias, relative};
use super::report::Check;
use super::sample::Sample;
use ff_dynamics::{State, Work, mass_matrix};
use ff_model::port::TwinBody;
use ff_model::scalar::ModelScalar;
use ff_model::tree::JointLimits;
use ff_model::{BaseKind, DynAppendage, Inertia, Joint, JointKind, Model, Params};
use nalgebra::DMatrix;

/// See [`law::TWIN`]. The twin hangs from a massless body that moves as the host does, so that its mass matrix is `M`
/// and its bias, springs and dampers added, is `h`; both at nominal parameters.
pub(super) fn twin(a: &dyn DynAppendage, bodies: &[TwinBody], samples: &[Sample]) -> Check {
    let decl = a.declaration();
    let n = decl.coords.len();
    if bodies.len() != n {
        let fault = format!("{} bodies in the twin, {n} coordinates in the declaration", bodies.len());
        return Check::faults(law::TWIN, &[fault]);
    }
    if let Some(i) = (0..n).find(|&i| bodies[i].parent.is_some_and(|p| p >= i)) {
        return Check::faults(law::TWIN, &[format!("twin body {i} comes before its parent")]);
    }
    let tree = tree(bodies);
    let p: Vec<f64> = decl.params.iter().map(|p| p.nominal).collect();
    let params = Params::nominal(&tree);
    let mut work = Work::new(&tree);
    let (mut m, mut h) = (DMatrix::zeros(6 + n, 6 + n), vec![0.0; 6 + n]);
    let mut worst = Worst::default();
    for s in samples {
        let mut state = State::zero(&tree);
        state.q.copy_from_slice(&s.eta);
        state.v.copy_from_slice(&s.y());
        mass_matrix(&tree, &params, &state, &mut work, &mut m);
        ff_dynamics::bias(&tree, &params, &state, &mut work, &mut h);
        for (i, b) in bodies.iter().enumerate() {
            h[6 + i] += b.stiffness * (s.eta[i] - b.rest) + b.damping * s.nu[i];
        }
        let have = matrix(f64::port(a), &p, &s.eta);
        let scale = amax(&have.concat());
        for i in 0..6 + n {
            for j in 0..6 + n {
                worst.see(relative(have[i][j], m[(i, j)], scale), || format!("M({i}, {j}) at eta = {:?}", s.eta));
            }
        }
        let have = bias(a, &p, s.host, &s.eta, &s.nu);
        let scale = amax(&have).max(amax(&h));
        for i in 0..6 + n {
            worst.see(relative(have[i], h[i], scale), || format!("h({i}) at eta = {:?}, nu = {:?}", s.eta, s.nu));
        }
    }
    worst.check(law::TWIN, 1e-11)
}

fn tree(bodies: &[TwinBody]) -> Model {
    let mut tree = Model::new("twin", "host", Inertia::zero(), BaseKind::Floating);
    for (i, b) in bodies.iter().enumerate() {
        let joint = Joint {
            name: format!("joint{i}"),
            kind: JointKind::Continuous,
            axis: b.axis,
            placement: b.placement,
            limits: JointLimits::default(),
        };
        tree.add_body(b.parent.map_or(0, |p| p + 1), format!("body{i}"), joint, b.inertia);
    }
    tree
}
