//! The paper's numbers, and what the study prints beside them.

use super::identify::Report;
use super::open::{Outcome, gain};
use super::score::Columns;
use super::summary::{REPORT, Runs, Summary};
use crate::interval::Interval;
use crate::table::{Table, sig};
use std::path::Path;
use validate::PathError;

/// The paper's tables: rows mean position, max position, mean rpy, max rpy; columns rigid, extended.
pub(super) const PAPER: [[[f64; 2]; 4]; 2] = [
    [[0.0181, 0.0094], [0.0210, 0.0192], [0.1542, 0.0584], [0.2032, 0.0921]],
    [[0.0367, 0.0214], [0.1242, 0.0924], [0.2319, 0.1154], [0.4291, 0.3299]],
];

/// An error of a path.
type Pick = fn(&PathError) -> f64;

/// Rows of Tables II and III, the paper's first.
const ROWS: [(&str, Pick); 6] = [
    ("mean pos (m)", |e| e.mean_pos_m),
    ("max pos (m)", |e| e.max_pos_m),
    ("mean rpy (rad)", |e| e.mean_rpy_rad),
    ("max rpy (rad)", |e| e.max_rpy_rad),
    ("mean angle (rad)", |e| e.mean_angle_rad),
    ("max angle (rad)", |e| e.max_angle_rad),
];

/// Prints everything to standard output.
#[allow(clippy::print_stdout)] // printing is the purpose
pub(super) fn all(s: &Summary, out: &Path) {
    for t in tables(s) {
        println!("{t}");
    }
    println!("{}", identifications(&s.identified));
    for c in &s.conclusions {
        let (k, n) = c.holds;
        println!("{}: {} ({k} of {n})", c.said, c.word());
    }
    println!(
        "\n{} after {:.1} s; figures (PNG, SVG), series (CSV), summary.json beside it",
        out.join(REPORT).display(),
        s.wall_s
    );
}

/// Tables II and III beside the paper's, and the frequencies.
pub(super) fn tables(s: &Summary) -> [Table; 3] {
    let two = table("Table II: end-effector error, flexible panels", &s.table2, &PAPER[0], "Flex. ID");
    let three = table("Table III: end-effector error, fuel slosh", &s.table3, &PAPER[1], "Slosh. ID");
    let mut t = Table::new("Natural frequencies (Hz)", &["", "measured", "model", "paper"]);
    let list = |v: &[f64]| v.iter().map(|x| format!("{x:.3}")).collect::<Vec<_>>().join(" ");
    for (name, f) in [("Fig. 5, panels", &s.fig5), ("Fig. 7, slosh", &s.fig7)] {
        t.row([name.into(), list(&f.measured_hz), list(&f.model_hz), list(&f.paper_hz)]);
    }
    t.note(format!(
        "Slosh: Table I gives {:.4} Hz with the base held, and a free base can only raise it; 0.06 Hz does not follow.",
        s.fig7.cantilever_hz
    ));
    [two, three, t]
}

/// Every fit of Tables II and III.
pub(super) fn identifications(all: &[Report]) -> Table {
    let head = ["case", "run", "model", "directions seen", "to 10 %", "worst error of these", "steps", "chi2/dof"];
    let mut t = Table::new("Identifications", &head).left(3);
    all.iter().for_each(|r| _ = t.row(r.cells()));
    t.note("To 10 %: combinations of parameters that the record tells to a tenth of their size; errors are relative, against the truth.");
    t
}

fn table(title: &str, runs: &Runs, paper: &[[f64; 2]; 4], extended: &str) -> Table {
    let of = format!("{extended}, truth");
    let head = [
        "",
        "error",
        "paper Rigid ID",
        &format!("paper {extended}"),
        "Rigid ID",
        extended,
        "Rigid ID, truth",
        &of,
        "gain",
    ];
    let mut t = Table::new(title, &head).left(2);
    let mut block = |run: &str, c: &Columns| {
        if run == "noisy" {
            t.rule();
        }
        for (i, (name, pick)) in ROWS.iter().enumerate() {
            let printed = |k: usize| paper.get(i).map_or_else(String::new, |r| sig(r[k], 3));
            t.row([
                if i == 0 { run.to_owned() } else { String::new() },
                (*name).to_owned(),
                printed(0),
                printed(1),
                sig(pick(&c.rigid_id), 3),
                sig(pick(&c.extended_id), 3),
                sig(pick(&c.rigid_id_vs_truth), 3),
                sig(pick(&c.extended_id_vs_truth), 3),
                sig(gain(c, *pick), 3),
            ]);
        }
    };
    block("noise-free", &runs.noise_free);
    block("noisy", &runs.noisy);
    t.note("ID columns: against the rigid reference model, as in the paper; a flexible model cannot reach zero there.");
    t.note("Truth: against the simulated satellite itself. Gain: rigid over extended, against the truth.");
    t
}

/// Tables II and III over trials: geometric means with their 95 % intervals. `k` is 0 for panels, 1 for fuel.
pub(super) fn repeated(o: &Outcome, k: usize) -> Table {
    let extended = ["Flex. ID", "Slosh. ID"][k];
    let (n, of) = (o.ended().count(), o.trials.len());
    let title = format!("Over {n} trials, each with trajectories, noise and starts of its own");
    let head = [
        "error",
        "paper Rigid ID",
        "Rigid ID",
        &format!("paper {extended}"),
        extended,
        "Rigid ID, truth",
        &format!("{extended}, truth"),
        "gain",
    ];
    let mut t = Table::new(title, &head);
    let paper = &PAPER[k];
    for (i, (name, pick)) in ROWS.iter().enumerate() {
        let printed = |k: usize| paper.get(i).map_or_else(String::new, |r| sig(r[k], 3));
        let over = |f: &dyn Fn(&Columns) -> f64| o.interval(f).map_or_else(String::new, |x| words(&x));
        t.row([
            (*name).to_owned(),
            printed(0),
            over(&|c| pick(&c.rigid_id)),
            printed(1),
            over(&|c| pick(&c.extended_id)),
            over(&|c| pick(&c.rigid_id_vs_truth)),
            over(&|c| pick(&c.extended_id_vs_truth)),
            over(&|c| gain(c, *pick)),
        ]);
    }
    t.note("Noisy records. Geometric mean and, in brackets, its 95 % interval (Student's t over the logarithms).");
    if n < of {
        t.note(format!("{} of {of} extended fits did not converge and are left out.", of - n));
    }
    t
}

/// `0.0123 [0.0101, 0.0150]`.
pub(super) fn words(x: &Interval) -> String {
    match x.interval95 {
        Some((a, b)) => format!("{} [{}, {}]", sig(x.mean, 3), sig(a, 3), sig(b, 3)),
        None => sig(x.mean, 3),
    }
}
