//! Forward dynamics: all accelerations free, or with prescribed joint motion.
//!
//! Both come from the same two passes: forces at zero unknown acceleration (recursive Newton-Euler), and
//! composite inertias. Free dynamics solve with the mass matrix, whose sparsity is that of the tree
//! (`ltl.rs`); in trees that are deep ([`DEEP`]) the articulated-body algorithm ([`mod@crate::tree::aba::aba`]), whose cost is
//! linear, takes over. With prescribed joints only base and passive coordinates are unknown: appendages are
//! eliminated one by one, and what is left is 6 x 6.

use crate::linalg::ltl;
use crate::state::State;
use crate::tree::aba::{SingularInertia, aba};
use crate::tree::condense;
use crate::tree::crba;
use crate::tree::crba::mass_matrix;
use crate::tree::links as tree;
use crate::tree::rnea::rnea;
use crate::work::buffers::Work;
use crate::work::coupled::Coupled;
use ff_lanes::Kernel;
use ff_model::dispatch_rotation;
use ff_model::scalar::ModelScalar;
use ff_model::spatial::vec3::V3;
use ff_model::{Model, Params};

/// Mean number of joints between a body and the base, its own included, above which free forward dynamics of plain numbers
/// use the articulated-body algorithm.
///
/// What the mass matrix costs grows with the ancestors of each joint, not with the number of joints: on chains of
/// `examples/crossover.rs` the two cross at 12 to 13 joints on one chain (mean 6.5 to 7) and at 25 on two.
pub const DEEP: f64 = 6.75;

/// The same as a number of joints for lanes and derivatives, by operation counts: the articulated-body code is not
/// compiled for the instructions of lanes.
const MANY: usize = 20;

/// Accelerations for given forces: `a = H^-1 (tau - c)`.
///
/// `tau = [external base wrench | joint torques | external passive forces]`, all `nv` long; springs, dampers,
/// gravity and [`Work::set_external`] are added by the model. Does not allocate except for the error.
///
/// Source: Featherstone 2008, tables 5.1, 6.2 and 6.3; table 7.1 in trees beyond [`DEEP`].
///
/// # Errors
/// [`SingularInertia`] where a pivot is not positive.
///
/// # Panics
/// If a slice has the wrong length.
pub fn forward_dynamics<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    tau: &[T],
    work: &mut Work<T>,
    a: &mut [T],
) -> Result<(), SingularInertia> {
    let plain = size_of::<T>() == size_of::<f64>();
    if work.coupled.is_some() {
        return by_mass_matrix(model, params, state, tau, work, a);
    }
    let deep = if plain { work.mean_depth > DEEP } else { model.nj() > MANY };
    if deep {
        return aba(model, params, state, tau, work, a);
    }
    by_mass_matrix(model, params, state, tau, work, a)
}

/// [`forward_dynamics`] by the mass matrix and its sparse factorisation, whatever the number of joints.
///
/// # Errors
/// As [`forward_dynamics`].
///
/// # Panics
/// As [`forward_dynamics`].
pub fn by_mass_matrix<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    tau: &[T],
    work: &mut Work<T>,
    a: &mut [T],
) -> Result<(), SingularInertia> {
    let solved = match work.over_tree(|work, c| {
        assert_eq!((a.len(), tau.len()), (model.nv(), model.nv()), "acceleration and tau length");
        c.set(model, state);
        c.a.fill(T::zero());
        rnea(&c.tree, params, &c.state, &c.a, work, &mut c.tau);
        c.forces(a);
        a.iter_mut().zip(tau).for_each(|(a, &t)| *a = t - *a);
        mass_matrix(&c.tree, params, &c.state, work, &mut c.h);
        c.fold_mass();
        ltl::solve(&mut c.lower, model.nb(), &c.dense, a)
    }) {
        Some(solved) => solved,
        None => T::enter(Free { model, params, state, tau, work, a }),
    };
    solved.map_err(|dof| {
        let at = match dof {
            d if d < model.nb() => format!("base {}", model.body_name(0)),
            d if d < model.nb() + model.nj() => format!("joint {}", model.own_body(d - model.nb()).joint.name),
            d => appendage_of(model, d - model.nb() - model.nj()),
        };
        SingularInertia { at }
    })
}

fn appendage_of(model: &Model, coord: usize) -> String {
    let a = model.appendages().iter().rfind(|a| a.coord_offset <= coord);
    format!("appendage {}", a.map_or("", |a| a.name.as_str()))
}

struct Free<'a, T: ModelScalar> {
    model: &'a Model,
    params: &'a Params<T>,
    state: &'a State<T>,
    tau: &'a [T],
    work: &'a mut Work<T>,
    a: &'a mut [T],
}

/// Wrenches and joint forces at zero acceleration of every unknown, `qdd` given; port residuals likewise.
#[inline(always)]
fn forces<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    qdd: &[T],
    work: &mut Work<T>,
    joint: &mut [T],
) {
    let links = &mut work.links[..];
    tree::place(links, &state.q);
    tree::move_base(model, state, links, V3::zero(), V3::zero());
    tree::drive(params, links, state.qd(), qdd, work.has_external.then_some(&work.external[..]));
    tree::carry_velocities(model, state, links);
    tree::port_terms(model, params, state, links, &mut work.ports);
    tree::gather(links, joint);
}

impl<T: ModelScalar> Kernel for Free<'_, T> {
    type Output = Result<(), usize>;
    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { model, params, state, tau, work, a } = self;
        let (nb, nj, nv) = (model.nb(), model.nj(), model.nv());
        assert_eq!(tau.len(), nv, "tau length");
        assert_eq!(a.len(), nv, "acceleration length");
        let zeros = std::mem::take(&mut work.zeros);
        forces(model, params, state, &zeros[..nj], work, &mut a[nb..nb + nj]);
        work.zeros = zeros;
        for i in 0..nj {
            a[nb + i] = tau[nb + i] - a[nb + i];
        }
        if nb == 6 {
            let l = &work.links[0];
            (V3::from_slice(tau) - l.f).write_to(a);
            (V3::from_slice(&tau[3..]) - l.n).write_to(&mut a[3..]);
        }
        for (ap, p) in model.appendages().iter().zip(&work.ports) {
            for k in 0..p.n {
                let row = nb + nj + ap.coord_offset + k;
                a[row] = tau[row] - p.r[6 + k];
            }
        }
        tree::compose(model, params, &mut work.links, &work.ports);
        let mut h = std::mem::take(&mut work.lower);
        crba::columns::<T, false>(model, work, &mut h);
        let done = ltl::solve(&mut h, nb, &work.dof_parent, a);
        work.lower = h;
        if nb == 6 {
            // The unknown was the classical acceleration of the base origin.
            (V3::from_slice(a) - tree::transport(model, state)).write_to(a);
        }
        done
    }
}

/// Base and passive accelerations and joint torques for prescribed joint accelerations.
///
/// This is the form of a position-controlled arm on a free base: joint motion in, everything else out.
/// `qdd` has length `n`; on return `a` (`nv`) holds all accelerations (the joint part copied from `qdd`) and
/// `tau` (`n`) the joint torques. Wrenches of [`Work::set_external`] and forces of [`Work::set_passive_forces`] act as
/// well. Does not allocate except for the error.
///
/// With `C` the composite inertia, `G` the appendages' coupling at the base, `e` their residuals and `f` the
/// wrench at zero base acceleration:
///
/// ```text
/// (C - sum G M_ee^-1 G^T) A = -f + sum G M_ee^-1 e,     nu' = -M_ee^-1 (e + G^T A),
/// tau_j = tau_j(A = 0, nu' = 0) + S_j . (C_j A_j + carried G nu').
/// ```
///
/// # Errors
/// [`SingularInertia`] where a pivot is not positive.
///
/// # Panics
/// If a slice has the wrong length.
pub fn hybrid_dynamics<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    qdd: &[T],
    work: &mut Work<T>,
    a: &mut [T],
    tau: &mut [T],
) -> Result<(), SingularInertia> {
    let solved = match work.over_tree(|work, c| {
        let (nb, nj) = (model.nb(), model.nj());
        assert_eq!((qdd.len(), tau.len(), a.len()), (nj, nj, model.nv()), "lengths of qdd, tau, a");
        c.set(model, state);
        a[nb..nb + nj].copy_from_slice(qdd);
        c.accelerate(a);
        let (Coupled { tree, state, a: full, joint, tau: force, .. }, n) = (&mut *c, model.n_joints());
        joint.copy_from_slice(&full[nb..nb + n]);
        let run = Hybrid { model: tree, params, state, qdd: joint, work, a: full, tau: &mut force[nb..nb + n] };
        let solved = T::enter(run);
        a[..nb].copy_from_slice(&c.a[..nb]);
        a[nb + nj..].copy_from_slice(&c.a[nb + n..]);
        if let Some(map) = model.coordinates() {
            map.torques(&c.tau[nb..nb + n], tau);
        }
        solved
    }) {
        Some(solved) => solved,
        None => T::enter(Hybrid { model, params, state, qdd, work, a, tau }),
    };
    solved.map_err(|at| singular(model, at))
}

/// The error for an appendage, or the base, whose mass matrix is not positive definite.
#[cold]
pub(crate) fn singular(model: &Model, at: Option<usize>) -> SingularInertia {
    SingularInertia {
        at: match at {
            Some(k) => format!("appendage {}", model.appendages()[k].name),
            None => format!("base {}", model.body_name(0)),
        },
    }
}

struct Hybrid<'a, T: ModelScalar> {
    model: &'a Model,
    params: &'a Params<T>,
    state: &'a State<T>,
    qdd: &'a [T],
    work: &'a mut Work<T>,
    a: &'a mut [T],
    tau: &'a mut [T],
}

impl<T: ModelScalar> Kernel for Hybrid<'_, T> {
    /// The appendage with a pivot that is not positive, or `None` for the base.
    type Output = Result<(), Option<usize>>;
    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { model, params, state, qdd, work, a, tau } = self;
        let (nb, nj) = (model.nb(), model.nj());
        assert_eq!(qdd.len(), nj, "qdd length");
        assert_eq!(tau.len(), nj, "tau length");
        assert_eq!(a.len(), model.nv(), "acceleration length");
        forces(model, params, state, qdd, work, tau);
        if work.has_passive {
            for (ap, p) in model.appendages().iter().zip(&mut work.ports) {
                for k in 0..p.n {
                    p.r[6 + k] -= work.external_passive[ap.coord_offset + k];
                }
            }
        }
        tree::compose(model, params, &mut work.links, &work.ports);
        let (al0, a0) = if nb == 6 {
            for (ap, p) in model.appendages().iter().zip(&mut work.ports) {
                for j in 0..p.n {
                    let (f, n) = p.mass().coupling(j);
                    let (mut f, mut n) = p.up(&f, &n);
                    let mut at = ap.host;
                    while at > 0 {
                        (f, n) = tree::inwards(&work.links[at], &f, &n);
                        at = work.links[at].parent;
                    }
                    p.g[j] = (f, n);
                }
            }
            let l = &work.links[0];
            let (a0, al0) = condense::base_acceleration(&mut work.ports, &l.ic, &l.f, &l.n)?;
            (al0, a0)
        } else {
            for (k, p) in work.ports.iter_mut().enumerate() {
                if !condense::alone(p) {
                    return Err(Some(k));
                }
            }
            (V3::zero(), V3::zero())
        };
        let passive = &mut a[nb + nj..];
        for (ap, p) in model.appendages().iter().zip(&work.ports) {
            p.respond((nb == 6).then_some((&a0, &al0)), &mut passive[ap.coord_offset..]);
        }
        if nb == 6 {
            (a0 - tree::transport(model, state)).write_to(a);
            al0.write_to(&mut a[3..]);
        }
        a[nb..nb + nj].copy_from_slice(qdd);
        // Joint torques: the base acceleration carried outwards, appendages on links carried inwards.
        let links = &mut work.links[..];
        (links[0].a, links[0].al) = (a0, al0);
        for i in 1..links.len() {
            let (inner, outer) = links.split_at_mut(i);
            let l = &mut outer[0];
            tau[i - 1] += dispatch_rotation!(T, l.pose.turn, K => l.lean::<K>(&inner[l.parent]));
        }
        for (ap, p) in model.appendages().iter().zip(&work.ports).filter(|(ap, _)| ap.host > 0) {
            let (mut f, mut n) = (V3::zero(), V3::zero());
            for k in 0..p.n {
                let x = a[nb + nj + ap.coord_offset + k];
                let (pf, pn) = p.mass().coupling(k);
                (f, n) = (pf.scale_add(x, &f), pn.scale_add(x, &n));
            }
            (f, n) = p.up(&f, &n);
            let mut at = ap.host;
            while at > 0 {
                tau[at - 1] += links[at].force_of(&f, &n);
                (f, n) = tree::inwards(&links[at], &f, &n);
                at = links[at].parent;
            }
        }
        Ok(())
    }
}
