//! The verdict on a trajectory as a page: `report.html` of `ffid plan` and `ffid excite`.

use super::opening::opening;
use crate::page::{Block, Cell, Level, Page, Table, points};
use crate::plot::{Figure, typeset};
use ffid::exit::Failure;
use ffid::workflow::identify::{BudgetLine, num};
use ffid::workflow::preflight::{Determination, LimitMargin, ModeVisibility, Predicted, Preflight, Proof, Seen};

/// Part of a variance from which it is listed.
const SEEN: f64 = 0.005;

/// The page. `plan` is how the trajectory was found, in words; none for one that was given.
///
/// # Errors
/// Those of [`Figure::to_svg`].
pub fn page(v: &Preflight, plan: Option<&str>, figures: &[(&'static str, Figure)]) -> Result<String, Failure> {
    let mut page = Page::new(format!("Trajectory for {}", v.robot));
    page.open_with(opening(v));
    let points = points(figures.iter().map(|(_, f)| f));
    let drawn = |stem: &str| -> Result<Vec<Block>, Failure> {
        figures.iter().filter(|(s, _)| *s == stem).map(|(_, f)| Block::figure(f, points)).collect()
    };
    let mut parameters = vec![Block::text(
        "Standard deviations that a record of this trajectory will leave, at the values of the mission, biases and initial state \
         estimated beside them.",
    )];
    let all: Vec<&Predicted> = v.parameters.iter().chain(&v.derived).collect();
    parameters.push(Block::Table(table("Predicted", &all)));
    let silent = |what: &str, d: &[ident::belief::Direction]| -> Vec<String> {
        d.iter().map(|d| format!("{what}: {d}")).collect()
    };
    let mut said = silent("silent on", &v.null_directions);
    said.extend(silent("known worse than its own size", &v.weak_directions));
    if !said.is_empty() {
        parameters.push(Block::List(said));
    }
    if !v.budget.is_empty() {
        parameters.push(Block::text(
            "Where the variance will come from (%): noise of the sensors, and what the mission is not sure of.",
        ));
        parameters.push(Block::Table(budget(&v.budget)));
    }
    page.section("What it will tell", parameters);
    let mut modes = Vec::new();
    if !v.modes.is_empty() {
        modes.push(Block::Table(seen(&v.modes)));
    }
    page.section("Who sees the modes", modes);
    page.section("Trajectory", drawn("trajectory")?);
    page.section("What the robot does", drawn("response")?);
    let rest = figures.iter().filter(|(s, _)| !matches!(*s, "trajectory" | "response"));
    page.section("Excitation", rest.map(|(_, f)| Block::figure(f, points)).collect::<Result<_, _>>()?);
    page.section("Limits", limits(&v.limits));
    let mut whole = Vec::new();
    whole.extend(plan.map(|p| Block::Code(p.to_owned())));
    whole.push(Block::Details("The verdict as text".into(), vec![Block::Code(v.to_string())]));
    page.section("In full", whole);
    Ok(page.render())
}

fn budget(all: &[BudgetLine]) -> Table {
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    let row = |b: &BudgetLine| {
        let errors = b.errors.iter().filter(|e| e.share > SEEN);
        let errors: Vec<String> = errors.map(|e| format!("{} {}", e.kind.words(), percent(e.share))).collect();
        let better = b.better.as_ref().map_or_else(String::new, |x| {
            format!("{} {:.0} times better: {} {}", x.kind.words(), x.factor, num(x.std), typeset(&b.unit))
        });
        vec![
            Cell::words(b.name.clone()),
            Cell::number(num(b.std)),
            Cell::number(percent(b.noise)),
            Cell::words(errors.join(", ")),
            Cell::words(better),
        ]
    };
    let head = ["name", "std", "noise", "errors", "std with the next step"].map(String::from).to_vec();
    Table { caption: "Error budget".into(), head, rows: all.iter().map(row).collect() }
}

fn table(caption: &str, all: &[&Predicted]) -> Table {
    let row = |p: &&Predicted| {
        let (level, word) = match p.told {
            Determination::Well => (Level::Good, "told"),
            Determination::Weakly => (Level::Fair, "weak"),
            Determination::NotAtAll => (Level::Bad, "not at all"),
        };
        vec![
            Cell::words(p.name.clone()),
            Cell::number(num(p.value)),
            Cell::words(typeset(&p.unit)),
            Cell::number(p.std.map_or_else(|| "cannot be told".into(), num)),
            Cell::number(p.relative_std.map_or_else(String::new, |r| format!("{:.3}", 100.0 * r))),
            Cell::Mark(level, word.into()),
        ]
    };
    let head = ["name", "value", "unit", "std", "%", "verdict"].map(String::from).to_vec();
    Table { caption: caption.into(), head, rows: all.iter().map(row).collect() }
}

fn seen(all: &[ModeVisibility]) -> Table {
    let rows = all.iter().flat_map(|m| {
        [("torques", &m.torque), ("gyro", &m.gyro)].map(|(sensor, r)| {
            let (level, word) = match r.seen {
                Seen::Plainly => (Level::Good, "seen"),
                Seen::Buried => (Level::Fair, "seen over the record"),
                Seen::Not => (Level::Bad, "not seen"),
            };
            vec![
                Cell::number(format!("{:.4}", m.frequency_hz)),
                Cell::number(format!("{:.2}", 100.0 * m.damping_ratio)),
                Cell::words(sensor),
                Cell::number(num(r.peak_over_noise)),
                Cell::number(num(r.record_snr)),
                Cell::Mark(level, word.into()),
            ]
        })
    });
    let head = ["mode (Hz)", "damping (%)", "sensor", "peak / noise", "record / noise", "verdict"].map(String::from);
    Table { caption: "Modes at the start pose, joints held".into(), head: head.to_vec(), rows: rows.collect() }
}

fn limits(all: &[LimitMargin]) -> Vec<Block> {
    if all.is_empty() {
        return Vec::new();
    }
    let mut sorted: Vec<&LimitMargin> = all.iter().collect();
    sorted.sort_by(|a, b| a.relative().total_cmp(&b.relative()));
    let row = |m: &&LimitMargin| {
        let (level, word) = if m.holds { (Level::Good, "kept") } else { (Level::Bad, "broken") };
        vec![
            Cell::words(format!("{} of {}", m.what, m.item)),
            Cell::number(num(m.bound)),
            Cell::number(num(m.limit)),
            Cell::words(typeset(&m.unit)),
            Cell::number(format!("{:.2}", m.time_s)),
            Cell::words(if m.proof == Proof::AllTime { "for all time" } else { "simulated" }),
            Cell::Mark(level, word.into()),
        ]
    };
    let head = ["limit", "value", "limit", "unit", "about (s)", "rests on", ""].map(String::from).to_vec();
    vec![Block::Table(Table { caption: "Closest first".into(), head, rows: sorted.iter().map(row).collect() })]
}
