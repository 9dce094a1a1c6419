//! `ffid check`: is this mission, or this URDF, what its author thinks it is?

use crate::output::{Input, Outcome};
use ff_dynamics::Boundary;
use ff_mission::Mission;
use ff_model::{Area, Problem};
use ffid::exit::Exit;
use ffid::inputs::Lines;
use ffid::modes::ModeTable;
use ffid::open::{MAX_DENSE, open};
use ffid::summary::Summary;
use ffid::workflow::identify::DeclaredUncertain;
use serde::Serialize;
use std::fmt::Display;
use std::io::Write;

/// Results in JSON; all absent when the file was refused.
#[derive(Default, Serialize)]
struct Results<'a> {
    model: Option<&'a Summary>,
    /// Absent when there is nothing passive.
    modes: Option<&'a ModeTable>,
    /// What the mission is not sure of; absent where it is sure of everything.
    uncertain: Option<&'a DeclaredUncertain>,
    /// Absent for a URDF alone.
    mission: Option<&'a Mission>,
}

/// Checks the file and prints the outcome.
pub(crate) fn run(input: &Input, out: &mut impl Write, err: &mut impl Write) -> Outcome {
    let opened = match open(&input.file, input.leniency()) {
        Ok(o) => o,
        Err(problems) => return input.print(Exit::of(&problems), &problems, Results::default(), &[], out, err),
    };
    let (model, mut problems) = (&opened.model, opened.warnings.clone());
    let summary = Summary::new(model, &opened.estimated);
    let mut modes = None;
    // Beyond the dense limit there is a warning already.
    if model.np() > 0 && model.nv() <= MAX_DENSE {
        match ModeTable::new(model, &opened.pose(), Boundary::JointsHeld) {
            Ok(table) => modes = Some(table),
            Err(e) => problems.push(
                Problem::warning(Area::Model, "Model::NoModes", e.to_string())
                    .in_file(&input.file)
                    .hint("check the stiffness of the appendages"),
            ),
        }
    }
    let uncertain = DeclaredUncertain::of(&opened);
    let results = Results {
        model: Some(&summary),
        modes: modes.as_ref(),
        uncertain: uncertain.as_ref(),
        mission: opened.mission.as_ref(),
    };
    let inputs = opened.mission.as_ref().filter(|m| !m.inputs.is_empty()).map(|m| Lines(&m.inputs));
    let text: [Option<&dyn Display>; 4] = [
        Some(&summary),
        uncertain.as_ref().map(|u| u as _),
        inputs.as_ref().map(|i| i as _),
        modes.as_ref().map(|m| m as _),
    ];
    input.print(Exit::of(&problems), &problems, results, &text, out, err)
}
