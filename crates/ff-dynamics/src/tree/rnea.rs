//! Inverse dynamics by the recursive Newton-Euler algorithm (RNEA).

use crate::state::State;
use crate::tree::links as tree;
use crate::work::buffers::Work;
use ff_lanes::Kernel;
use ff_model::scalar::ModelScalar;
use ff_model::{Model, Params, PortMatrix};

/// Generalised forces for given accelerations: `tau = H(q) a + c(q, v)`.
///
/// Rows are `[base wrench (base frame, about the base origin) | joint torques | passive rows]`. The passive
/// rows contain springs and dampers: they are zero in free motion, and a non-zero value is the generalised
/// force that would have to act from outside. Gravity and [`Work::set_external`] wrenches are included.
///
/// Source: J. Luh, M. Walker, R. Paul 1980; R. Featherstone, *Rigid Body Dynamics Algorithms*, 2008, table
/// 5.1; ports added on the hosts. `a` and `tau` have length `nv`. Does not allocate. Cost `O(n + m)`.
///
/// # Panics
/// If a slice has the wrong length.
pub fn rnea<T: ModelScalar>(
    model: &Model,
    params: &Params<T>,
    state: &State<T>,
    a: &[T],
    work: &mut Work<T>,
    tau: &mut [T],
) {
    let folded = work.over_tree(|work, c| {
        assert_eq!((a.len(), tau.len()), (model.nv(), model.nv()), "acceleration and tau length");
        c.set(model, state);
        c.accelerate(a);
        rnea(&c.tree, params, &c.state, &c.a, work, &mut c.tau);
        c.forces(tau);
    });
    if folded.is_some() {
        return;
    }
    T::enter(Rnea { model, params, state, a, work, tau });
}

/// Velocity-dependent terms, springs, dampers and gravity: `c(q, v)`, [`rnea`] at zero acceleration.
///
/// # Panics
/// If `c` is not `nv` long.
pub fn bias<T: ModelScalar>(model: &Model, params: &Params<T>, state: &State<T>, work: &mut Work<T>, c: &mut [T]) {
    let zeros = match &mut work.coupled {
        Some(coupled) => std::mem::take(&mut coupled.zeros),
        None => std::mem::take(&mut work.zeros),
    };
    rnea(model, params, state, &zeros, work, c);
    match &mut work.coupled {
        Some(coupled) => coupled.zeros = zeros,
        None => work.zeros = zeros,
    }
}

struct Rnea<'a, T: ModelScalar> {
    model: &'a Model,
    params: &'a Params<T>,
    state: &'a State<T>,
    a: &'a [T],
    work: &'a mut Work<T>,
    tau: &'a mut [T],
}

impl<T: ModelScalar> Kernel for Rnea<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let Self { model, params, state, a, work, tau } = self;
        let (nb, nj) = (model.nb(), model.nj());
        assert_eq!(a.len(), model.nv(), "acceleration length");
        assert_eq!(tau.len(), model.nv(), "tau length");
        let links = &mut work.links[..];
        tree::place(links, &state.q);
        tree::accelerate_base(model, state, a, links);
        let external = work.has_external.then_some(&work.external[..]);
        tree::drive(params, links, state.qd(), &a[nb..nb + nj], external);
        tree::carry_velocities(model, state, links);
        for (k, (ap, p)) in model.appendages().iter().zip(&mut work.ports).enumerate() {
            let (mut m, mut r) = (std::mem::take(&mut p.m), std::mem::take(&mut p.r));
            tree::port_motion(model, state, a, ap, p, &links[ap.host], false, |s, acc| {
                let mut scratch = PortMatrix::over(p.n, &mut m);
                T::port(&*ap.appendage).residual(params.appendage(model, k), s, acc, &mut scratch, &mut r);
            });
            (p.m, p.r) = (m, r);
            let passive = nb + nj + ap.coord_offset..nb + nj + ap.coord_offset + p.n;
            p.press(&mut links[ap.host]);
            for (t, &r) in tau[passive].iter_mut().zip(&p.r[6..]) {
                *t = r;
            }
        }
        tree::gather(links, &mut tau[nb..nb + nj]);
        if nb == 6 {
            links[0].f.write_to(tau);
            links[0].n.write_to(&mut tau[3..]);
        }
    }
}
