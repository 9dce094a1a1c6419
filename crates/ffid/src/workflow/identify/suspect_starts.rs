//! Where fits to the shape of the signals begin ([`super::suspects`]).

use super::assembly::Setup;
use super::error::IdentifyError;
use super::labelled_record::LabelledRecord;
use super::ringing;
use ff_model::{Inertia, Model};
use ident::estimate::Estimate;
use nalgebra::{Matrix3, Vector3};

/// Masses of what a link may hold, over that of the whole robot, and density (kg/m^3).
const CLIENTS: [f64; 3] = [0.02, 0.08, 0.3];
const DENSITY: f64 = 200.0;

/// At the mission, with clients of several sizes where one is adopted, where an appendage rings as the records do, and where the first fit was stuck. Springs
/// that are a third too stiff slip by a period within some, and no error is seen behind that.
pub(super) fn starts(
    model: &Model,
    records: &[LabelledRecord],
    setup: &Setup,
    stuck: &Estimate,
) -> Result<Vec<Vec<f64>>, IdentifyError> {
    let mut out = vec![setup.unknowns.start.clone()];
    out.extend(setup.settings.adopt.iter().flat_map(|name| clients(setup, name)));
    out.extend(ringing::starts(model, records, &setup.unknowns, &setup.settings.noise, &setup.request()?));
    out.push(stuck.values.clone());
    Ok(out)
}

/// Starts at which a link that may hold something holds a ball, of several masses and the density of spacecraft, that touches it where its own centre of mass
/// points to: a link that has to become many times as heavy takes a way that does not end. None for other errors.
pub(super) fn clients(setup: &Setup, error: &str) -> Vec<Vec<f64>> {
    let Some(link) = error.strip_prefix("held.") else { return Vec::new() };
    let unknowns = &setup.unknowns;
    let mass = format!("{link}.mass");
    let Some(link) = unknowns.decls.iter().position(|d| d.name == mass).filter(|&i| i + 10 <= unknowns.start.len())
    else {
        return Vec::new();
    };
    let own = Inertia::from_params(&unknowns.start[link..link + 10]);
    let whole = unknowns.decls.iter().zip(&unknowns.start).filter(|(d, _)| d.unit == "kg").map(|(_, x)| x).sum::<f64>();
    let Some(com) = own.com() else { return Vec::new() };
    let out = com.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z);
    let one = |part: &f64| {
        let mass = part * whole;
        let radius = (0.75 * mass / (std::f64::consts::PI * DENSITY)).cbrt();
        let ball = Matrix3::identity() * (0.4 * mass * radius.powi(2));
        let both = own + Inertia::from_com(mass, &(com + out * radius), &ball);
        let mut start = unknowns.start.clone();
        start[link..link + 10].copy_from_slice(&both.to_params());
        start
    };
    CLIENTS.iter().map(one).collect()
}
