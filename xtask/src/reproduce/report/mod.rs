//! The one report of the study, `report.html`: the paper's tables and figures beside ours, the errata with what they do, what the paper
//! leaves open, and three experiments that it does not do. One file, offline.

mod beyond;
mod model;
mod open;
mod schematics;
mod shown;

pub(super) use shown::Shown;

use super::errata::Errata;
use super::summary::{Runs, Summary};
use super::{checks, excitation, printed};
use crate::table::sig;
use ff_report::page::{Block, Cell, Level, Page, Table};
use ff_report::plot::Figure;
use shown::POINTS;

/// The page.
///
/// # Errors
/// Those of [`Figure::to_svg`]; a mission that cannot be read again.
pub(super) fn page(s: &Summary, shown: &Shown<'_>) -> anyhow::Result<String> {
    let mut page = Page::new("Free-floating robots with flexible appendages and fuel sloshing: the paper, reproduced");
    let outside = checks::outside(s);
    page.verdict(if outside.is_empty() { Level::Good } else { Level::Bad }, &verdict(s, &outside));
    page.section("What survives", open::conclusions(s));
    page.section("Model: Table I, Figs. 1 and 2", model::blocks(shown)?);
    page.section("Excitation", trajectories(shown)?);
    let [two, three, frequencies] = printed::tables(s);
    let mut panels = figures(&shown.panels[1..])?;
    panels.extend(two.blocks());
    panels.extend(open::repeated(s, "flex"));
    page.section("Flexible panels: Figs. 4 and 5, Table II", panels);
    let mut fuel = vec![schematics::free_body()];
    fuel.extend(figures(std::slice::from_ref(&shown.errata.forces))?);
    fuel.extend(figures(&shown.fuel[1..])?);
    fuel.extend(three.blocks());
    fuel.extend(open::repeated(s, "slosh"));
    page.section("Fuel slosh: Figs. 3, 6 and 7, Table III", fuel);
    page.section("Natural frequencies", frequencies.blocks());
    page.section("What the misprints do", errata(shown.errata)?);
    page.section("What the paper leaves open", open::sweep(s)?);
    page.section("Beyond the paper", beyond::blocks(&s.beyond)?);
    page.section("Every identification", printed::identifications(&s.identified).blocks());
    page.source("All numbers are in summary.json; series and figures are files beside it. Numbers of the paper are those that it prints.");
    Ok(page.render())
}

fn verdict(s: &Summary, outside: &[String]) -> Vec<String> {
    let mean = |r: &Runs| (mm(r.noisy.extended_id_vs_truth.mean_pos_m), mm(r.noisy.rigid_id_vs_truth.mean_pos_m));
    let ((panels, stiff), (fuel, frozen)) = (mean(&s.table2), mean(&s.table3));
    let mut out = vec![format!(
        "With the panels in the model the end effector is predicted to {panels} mm, without them to {stiff} mm; with the fuel to {fuel} mm, without it to {frozen} mm. \
         Means over a trajectory that no fit has seen, against the simulated satellite, from noisy sensors."
    )];
    let holds = |said: &str| s.conclusions.iter().find(|c| c.said.contains(said)).map(|c| c.holds);
    if let (Some((truth, n)), Some((reference, _))) =
        (holds("judged by the true satellite"), holds("rigid reference model"))
    {
        out.push(format!(
            "The extended model is closer to the true satellite in {truth} of {n} trials of other geometry, posture, noise and trajectories; judged as in the paper, by a \
             rigid reference model, it is closer in {reference}."
        ));
    }
    out.push(if outside.is_empty() {
        "Every figure of the study is within its limit.".to_owned()
    } else {
        format!("{} figures of the study are OUTSIDE their limits.", outside.len())
    });
    out.extend(outside.iter().cloned());
    if s.quick {
        out.push("This is a quick run: shorter trajectories, fewer parameters, looser limits.".to_owned());
    }
    out
}

fn mm(x: f64) -> String {
    sig(1e3 * x, 2)
}

fn figures(all: &[Figure]) -> anyhow::Result<Vec<Block>> {
    Ok(all.iter().map(|f| Block::figure(f, POINTS)).collect::<Result<Vec<_>, _>>()?)
}

/// What each trajectory is, and what it does to joints and modes.
fn trajectories(shown: &Shown<'_>) -> anyhow::Result<Vec<Block>> {
    let mut blocks = vec![Block::text(
        "A manoeuvre of the joints that are parallel to the hinges makes the modes ring. Three splines inside position, speed and acceleration limits serve the \
         identifications and their comparison: the identification trajectory maximises the determinant of the information on the base; the one for the rigid \
         identification does so, too, and pays for what the modes would do to torques and gyro; the reference is random.",
    )];
    let mut rows = Vec::new();
    for (case, x) in [("panels", shown.flex), ("fuel", shown.slosh)] {
        for line in excitation::lines(x) {
            let mut row = vec![Cell::words(format!("{case}: {}", line.name))];
            row.extend([line.seconds, line.rate, line.acceleration, line.modes].map(|x| Cell::number(sig(x, 3))));
            rows.push(row);
        }
    }
    let head = [
        "trajectory",
        "length (s)",
        "largest rate (rad/s)",
        "largest acceleration (rad/s\u{b2})",
        "at the modes (rad/s\u{b2}/\u{221a}Hz)",
    ];
    blocks.push(Block::Table(Table {
        caption: "At the modes: root of the spectral density of all joint accelerations at the natural frequencies, in the mean over these".into(),
        head: head.map(String::from).to_vec(),
        rows,
    }));
    blocks.extend(figures(&shown.panels[..1])?);
    blocks.extend(figures(&shown.fuel[..1])?);
    Ok(blocks)
}

fn errata(e: &Errata) -> anyhow::Result<Vec<Block>> {
    let row = |e: &super::errata::Effect| [e.items, e.printed, e.touches, e.effect.as_str()].map(Cell::words).to_vec();
    let mut out = vec![
        Block::text(
            "The list of errata, docs/paper-errata.md, says why each cannot stand. This is what each does to figures and tables; items that touch none are left out.",
        ),
        Block::Table(Table {
            caption: String::new(),
            head: ["item", "printed", "touches", "effect"].map(String::from).to_vec(),
            rows: e.effects.iter().map(row).collect(),
        }),
    ];
    out.extend(figures(std::slice::from_ref(&e.runaway))?);
    Ok(out)
}
