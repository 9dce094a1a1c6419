//! The report of a result: data to a page.

use super::charts;
use super::figures;
use super::names;
use super::opening::opening;
use super::over_time::over_time_figure;
use super::sampled;
use crate::page::{Block, Cell, Level, Page, Table, interval, points};
use crate::plot::{Figure, typeset};
use ffid::exit::Failure;
use ffid::workflow::identify::EXPLAINED;
use ffid::workflow::identify::Signals;
use ffid::workflow::identify::num;
use ffid::workflow::identify::{CandidateLine, ClockLine, DecayMode, DecayModes, ProfileLine, Whiteness};
use ffid::workflow::identify::{Channel, HeldOut, IdentificationResult, Method, NamedError, Parameter};
use ffid::workflow::identify::{ParameterVerdict, State};

/// Figures of a result with their file stems. `held` are the signals of data that were held out.
pub fn all_figures(r: &IdentificationResult, all: &[Signals], held: Option<&Signals>) -> Vec<(String, Figure)> {
    let mut out = Vec::new();
    for (k, s) in all.iter().enumerate() {
        // The first record keeps the plain names.
        let label = r.records.get(k).map(|r| r.label.as_str());
        let of = |what: &str| match label {
            Some(l) => format!("{}, {l}: {what}", r.robot),
            None => format!("{}: {what}", r.robot),
        };
        let stem = |what: &str| match label {
            Some(l) if k > 0 => format!("{what}-{l}"),
            _ => what.to_owned(),
        };
        out.push((stem("signals"), figures::signals(s, &of("measured and predicted"))));
        out.push((stem("residuals"), figures::residuals(s, &of("residuals, measured minus predicted"))));
        let spectra = figures::spectra(s, &r.modes, &of("spectra of signals and residuals"));
        out.extend(spectra.map(|f| (stem("spectra"), f)));
    }
    out.extend(over_time_figure(r));
    let of = |what: &str| format!("{}: {what}", r.robot);
    if let Some(h) = held {
        out.push(("held-out".into(), figures::signals(h, &of("data that were held out"))));
        out.push(("held-out-residuals".into(), figures::residuals(h, &of("residuals of the data that were held out"))));
    }
    out
}

/// The report of an identification; `replay` is the file beside it that shows the robot in motion, if there is one.
///
/// # Errors
/// Those of [`Figure::to_svg`].
pub fn page(r: &IdentificationResult, figures: &[(String, Figure)], replay: Option<&str>) -> Result<String, Failure> {
    let mut page = Page::new(format!("Identification of {}", r.robot));
    page.open_with(opening(r, level(r)));
    if let Some(file) = replay {
        page.lead(Block::Link { file: file.to_owned(), text: "See the robot move: 3-D replay".to_owned() });
    }
    let mut parameters = vec![
        Block::text(
            "Estimates with standard deviations (std) and 95 % intervals. In the drawing: wide and pale what was known before (the prior), thin \
             the interval of the estimate, a dot at its value, a tick where the fit started.",
        ),
        Block::Table(table("Parameters that were asked for", &r.parameters)),
    ];
    let meanings = names::meanings(&r.parameters);
    if !meanings.is_empty() {
        parameters.push(Block::Text(meanings));
    }
    if !r.nuisance.is_empty() {
        let beside = Block::Table(table("Biases and initial state", &r.nuisance));
        parameters.push(Block::Details("Biases and initial state, estimated beside them".into(), vec![beside]));
    }
    parameters.extend(chart(charts::intervals(r))?);
    parameters.extend(chart(charts::budget(r))?);
    page.section("Parameters", parameters);
    let points = points(figures.iter().map(|(_, f)| f));
    let drawn = |stems: &[&str]| -> Result<Vec<Block>, Failure> {
        let of = |s: &str| stems.iter().any(|w| s == *w || s.strip_prefix(w).is_some_and(|l| l.starts_with('-')));
        figures.iter().filter(|(s, _)| of(s)).map(|(_, f)| Block::figure(f, points)).collect()
    };
    let over_time = drawn(&["over-time"])?;
    page.section("What changes", over_time);
    page.section("What would explain the record", named(r).into_iter().collect());
    let mut signals = vec![];
    if r.records.is_empty() {
        signals.push(Block::Table(channels("Root mean squares over the record", &r.channels)));
    }
    for k in &r.records {
        let caption =
            format!("Record {}: {:.2} s, residuals {:.3} times the noise", k.label, k.seconds, k.mean_square.sqrt());
        signals.push(Block::Table(channels(&caption, &k.channels)));
    }
    signals.extend(drawn(&["signals"])?);
    page.section("Measured against predicted", signals);
    let mut residuals = drawn(&["residuals", "spectra"])?;
    residuals.extend(whiteness(r));
    residuals.extend(modes(r));
    residuals.extend(r.decay.iter().map(decay));
    residuals.extend(clocks(r));
    page.section("Residuals and their spectra", residuals);
    let mut draws = sampled::blocks(r);
    draws.extend(drawn(&["corner"])?);
    page.section("Draws from the posterior", draws);
    page.section("Models compared", comparison(r));
    if let Some(h) = &r.held_out {
        let mut blocks = held(h);
        blocks.extend(drawn(&["held-out", "held-out-residuals"])?);
        page.section("Data that were held out", blocks);
    }
    let mut told = identifiability(r);
    told.extend(chart(charts::correlations(r))?);
    told.extend(convergence(r));
    // Every linearisation is a point of it.
    told.extend(charts::descent(r).map(|f| Block::figure(&f, r.descent.len())).transpose()?);
    page.section("What the record can tell", told);
    page.section("Warnings", warnings(r));
    page.section("Provenance", provenance(r));
    Ok(page.render())
}

/// The report of a validation: a record that was not used.
///
/// # Errors
/// Those of [`Figure::to_svg`].
pub fn validation(robot: &str, h: &HeldOut, figures: &[(&'static str, Figure)]) -> Result<String, Failure> {
    let mut page = Page::new(format!("Validation of {robot}"));
    page.verdict(if h.explained { Level::Good } else { Level::Bad }, std::slice::from_ref(&h.verdict));
    page.section("Record", held(h));
    let points = points(figures.iter().map(|(_, f)| f));
    let all: Result<Vec<Block>, Failure> = figures.iter().map(|(_, f)| Block::figure(f, points)).collect();
    page.section("Measured against predicted", all?);
    Ok(page.render())
}

/// A chart, if there is one.
fn chart(f: Option<Figure>) -> Result<Option<Block>, Failure> {
    f.map(|f| Block::figure(&f, 0)).transpose()
}

/// How the fit went.
fn convergence(r: &IdentificationResult) -> Option<Block> {
    let mut rows = vec![
        ("end of the fit", r.status.to_string()),
        ("linearisations", r.iterations.to_string()),
        ("residuals", r.residuals.to_string()),
        ("chi-squared per degree of freedom", format!("{:.4}", r.chi2_per_dof)),
    ];
    if let Some(m) = &r.minima {
        rows.push(("starts that converged", format!("{} of {}", m.converged, m.starts)));
        let objectives: Vec<String> = m.objectives.iter().map(|o| num(*o)).collect();
        rows.push(("minima, by what was minimised", objectives.join(", ")));
    }
    let rows = rows.into_iter().map(|(k, v)| vec![Cell::words(k), Cell::words(v)]).collect();
    table_of("Convergence", &["", ""], rows)
}

fn level(r: &IdentificationResult) -> Level {
    let all = r.parameters.iter().all(|p| p.verdict == ParameterVerdict::Estimated);
    let explained = match r.evidence {
        Some(_) => r.state() == State::Explained || r.method == Method::Ground,
        None => r.chi2_per_dof <= EXPLAINED,
    };
    let explained = explained && r.held_out.as_ref().is_none_or(|h| h.explained);
    match (r.exit() == ffid::exit::Exit::Done, all && explained) {
        (false, _) => Level::Bad,
        (true, true) => Level::Good,
        (true, false) => Level::Fair,
    }
}

/// Column of the standard deviations.
const STD: usize = 3;
/// Column of the starts.
const START: usize = 5;

fn table(caption: &str, all: &[Parameter]) -> Table {
    // A column of its own where residuals are coloured.
    let coloured = all.iter().any(|p| p.std_coloured.is_some());
    let known = all.iter().any(|p| p.truth.is_some());
    let rows = all.iter().map(|p| {
        let prior = p.prior_mean.zip(p.prior_std);
        let level = match p.verdict {
            ParameterVerdict::Estimated => Level::Good,
            ParameterVerdict::Weak | ParameterVerdict::PriorOnly => Level::Fair,
            ParameterVerdict::AtBound | ParameterVerdict::NotIdentifiable => Level::Bad,
        };
        let mut row = vec![
            Cell::words(p.name.clone()),
            Cell::number(num(p.value)),
            Cell::words(typeset(&p.unit)),
            Cell::number(p.std.map_or_else(|| "cannot be told".into(), num)),
            Cell::number(p.interval95.map_or_else(String::new, |(a, b)| format!("{} .. {}", num(a), num(b)))),
            Cell::number(num(p.start)),
            Cell::number(prior.map_or_else(|| "none".into(), |(m, s)| format!("{} ± {}", num(m), num(s)))),
            interval(p.value, p.interval95, prior.map(|(m, s)| (m - 1.96 * s, m + 1.96 * s)), p.start),
            Cell::Mark(level, p.verdict.words().into()),
        ];
        if known {
            let off = p.deviations_off().map_or_else(String::new, |d| format!("{d:+.2}"));
            row.splice(START..START, [Cell::number(p.truth.map_or_else(String::new, num)), Cell::number(off)]);
        }
        if coloured {
            row.insert(STD + 1, Cell::number(p.std_coloured.map_or_else(String::new, num)));
        }
        row
    });
    let head = ["name", "value", "unit", "std", "95 % interval", "start", "prior", "estimate in its prior", "verdict"];
    let mut head = head.map(String::from).to_vec();
    if known {
        head.splice(START..START, ["truth", "estimate - truth, in std"].map(String::from));
    }
    if coloured {
        head.insert(STD + 1, "std, coloured noise".into());
    }
    Table { caption: caption.into(), head, rows: rows.collect() }
}

fn channels(caption: &str, all: &[Channel]) -> Table {
    let row = |c: &Channel| {
        vec![
            Cell::words(c.name.clone()),
            Cell::number(num(c.signal_rms)),
            Cell::number(num(c.residual_rms)),
            Cell::words(typeset(&c.unit)),
            Cell::number(format!("{:.3}", c.over_noise)),
        ]
    };
    Table {
        caption: caption.into(),
        head: ["channel", "signal", "residual", "unit", "residual / noise"].map(String::from).to_vec(),
        rows: all.iter().map(row).collect(),
    }
}

fn held(h: &HeldOut) -> Vec<Block> {
    vec![
        Block::text(format!(
            "{}: {} samples, {:.3} s. Parameters as estimated; in orbit biases and initial state, which belong to the record, are \
             fitted. Chi-squared per degree of freedom {:.4}, limit {}.",
            h.source, h.samples, h.seconds, h.chi2_per_dof, h.limit
        )),
        Block::Table(channels("Root mean squares over the record", &h.channels)),
    ]
}

fn modes(r: &IdentificationResult) -> Option<Block> {
    if r.modes.is_empty() {
        return None;
    }
    let row = |(i, m): (usize, &ffid::workflow::identify::ModeLine)| {
        vec![
            Cell::words(format!("mode {}", i + 1)),
            Cell::number(format!("{:.4}", m.frequency_hz)),
            Cell::number(format!("{:.2}", 100.0 * m.damping_ratio)),
            Cell::number(format!("{:.4}", m.start_hz)),
        ]
    };
    Some(Block::Table(Table {
        caption: "Modes at the pose of the mission, joints held".into(),
        head: ["", "identified (Hz)", "damping (%)", "at the start (Hz)"].map(String::from).to_vec(),
        rows: r.modes.iter().enumerate().map(row).collect(),
    }))
}

/// A table, but none without rows.
fn table_of(caption: &str, head: &[&str], rows: Vec<Vec<Cell>>) -> Option<Block> {
    let head = head.iter().map(|h| (*h).to_owned()).collect();
    (!rows.is_empty()).then(|| Block::Table(Table { caption: caption.into(), head, rows }))
}

fn whiteness(r: &IdentificationResult) -> Option<Block> {
    let row = |w: &Whiteness| {
        let hz: Vec<String> = w.stands_out_hz.iter().map(|f| format!("{f:.4}")).collect();
        let (level, word) = if w.white { (Level::Good, "white") } else { (Level::Fair, "coloured") };
        vec![
            Cell::words(w.channel.clone()),
            Cell::number(format!("{:.3}", w.mean_square.sqrt())),
            Cell::number(format!("{:+.3}", w.first_correlation)),
            Cell::number(num(w.white_p.min(w.portmanteau_p))),
            Cell::number(num(w.normal_p)),
            Cell::number(hz.join(", ")),
            Cell::Mark(level, word.into()),
        ]
    };
    let head = ["channel", "rms / noise", "next to it", "p white", "p normal", "stands out at (Hz)", "verdict"];
    table_of("Residuals against white noise", &head, r.whiteness.iter().map(row).collect())
}

fn decay(d: &DecayModes) -> Block {
    let cell = |x: Option<f64>, digits: usize| Cell::number(x.map_or_else(String::new, |x| format!("{x:.digits$}")));
    let row = |m: &DecayMode| {
        vec![
            Cell::number(format!("{:.4} ± {:.4}", m.frequency_hz, m.frequency_std_hz)),
            Cell::number(format!("{:.2} ± {:.2}", 100.0 * m.damping_ratio, 100.0 * m.damping_std)),
            cell(m.model_hz, 4),
            cell(m.model_damping.map(|d| 100.0 * d), 2),
            cell(m.mac, 3),
            Cell::words(m.note.clone()),
        ]
    };
    let mut rows: Vec<Vec<Cell>> = d.modes.iter().map(row).collect();
    rows.extend(d.unseen.iter().map(|u| {
        let none = || Cell::number(String::new());
        vec![
            Cell::number("not seen"),
            none(),
            cell(Some(u.frequency_hz), 4),
            none(),
            none(),
            Cell::words(u.why.clone()),
        ]
    }));
    let caption = format!(
        "Modes of the free decay of {}, {:.2} s to {:.2} s (a spectrum of it resolves {:.4} Hz)",
        d.record, d.from_s, d.to_s, d.resolution_hz
    );
    let head = ["measured (Hz)", "damping (%)", "model (Hz)", "damping (%)", "MAC", ""].map(String::from).to_vec();
    Block::Table(Table { caption, head, rows })
}

/// Errors that the record speaks for.
fn named(r: &IdentificationResult) -> Option<Block> {
    let e = r.evidence.as_ref()?;
    let row = |n: &NamedError| {
        vec![
            Cell::words(n.name.clone()),
            Cell::words(format!("{}{}", if n.beside { "and beside it " } else { "" }, n.text).replace(" +- ", " ± ")),
            Cell::number(num(n.drop)),
            Cell::words(format!("{} by {:.1}", n.moves, n.moves_by)),
            Cell::words(n.alike.join(", ")),
        ]
    };
    let caption = format!("Of {} errors that were tried; estimate it with --adopt and its name", e.tried);
    let head = ["error", "size", "chi-squared falls by", "moves (deviations)", "cannot be told from"];
    table_of(&caption, &head, e.named.iter().map(row).collect())
}

fn clocks(r: &IdentificationResult) -> Option<Block> {
    let row = |c: &ClockLine| {
        vec![
            Cell::words(format!("{} of {}", c.group, c.record)),
            Cell::number(format!("{:+.3} ± {:.3}", 1e3 * c.offset_s, 1e3 * c.offset_std_s)),
            Cell::number(format!("{:+.1} ± {:.1}", c.skew_ppm, c.skew_std_ppm)),
            Cell::words(if c.corrected { "corrected" } else { "left as it is" }.to_owned()),
        ]
    };
    let head = ["clock", "late (ms)", "fast (ppm)", ""];
    table_of("Clocks against that of the encoders", &head, r.clocks.iter().map(row).collect())
}

fn comparison(r: &IdentificationResult) -> Vec<Block> {
    let Some(c) = &r.comparison else { return Vec::new() };
    let row = |k: &CandidateLine| {
        let (level, word) = if k.name == c.recommended { (Level::Good, "recommended") } else { (Level::Fair, "") };
        vec![
            Cell::words(k.name.clone()),
            Cell::number(k.unknowns.to_string()),
            Cell::number(format!("{} ± {}", num(k.held_out), num(k.held_out_std))),
            Cell::number(num(k.aic)),
            Cell::number(num(k.bic)),
            Cell::number(format!("{:.3}", k.held_out_mean_square.sqrt())),
            Cell::Mark(level, word.into()),
        ]
    };
    let head = ["model", "unknowns", "-2 ln L held out", "AIC", "BIC", "residual / noise", ""];
    let caption = format!("Above the best of them; judged by {}", c.judged_by);
    let mut out = vec![Block::text(format!("{}: {}.", c.recommended, c.reason))];
    out.extend(table_of(&caption, &head, c.candidates.iter().map(row).collect()));
    out
}

fn profiles(r: &IdentificationResult) -> Option<Block> {
    let row = |p: &ProfileLine| {
        let end = |x: Option<f64>| x.map_or_else(|| "unbounded".to_owned(), num);
        vec![
            Cell::words(p.name.clone()),
            Cell::number(num(p.value)),
            Cell::words(typeset(&p.unit)),
            Cell::number(format!("{} .. {}", end(p.lower95), end(p.upper95))),
            Cell::number(p.gaussian95.map_or_else(String::new, |(a, b)| format!("{} .. {}", num(a), num(b)))),
        ]
    };
    let head = ["name", "value", "unit", "profile", "Gaussian"];
    table_of("95 % intervals from the likelihood itself", &head, r.profiles.iter().map(row).collect())
}

fn identifiability(r: &IdentificationResult) -> Vec<Block> {
    let n = r.singular_values.len();
    let mut out = vec![Block::text(format!(
        "{} of {n} unknowns are determined by the data alone (sensitivities scaled by the size of each parameter, biases and \
         initial state among them).",
        r.rank
    ))];
    let lines = |what: &str, all: &[ffid::workflow::identify::Combination]| -> Vec<String> {
        all.iter().map(|d| format!("{what}: {}", d.text)).collect()
    };
    let mut said = lines("silent on", &r.null_directions);
    if let Some(s) = &r.silent {
        said.extend(lines("by structure, so that no record could tell", &s.structural));
        said.extend(lines("not excited by this one", &s.unexcited));
    }
    if let Some(s) = &r.reduced {
        let held: Vec<String> = s.values.iter().map(|v| format!("{} at {} {}", v.name, num(v.value), v.unit)).collect();
        said.push(format!("held at the mission's values: {}", held.join(", ")));
        said.extend(s.combinations.iter().map(|c| format!("estimated for itself and for others: {}", c.text)));
    }
    said.extend(lines("known worse than its own size", &r.weak_directions));
    if let Some(m) = &r.minima {
        said.push(format!("{} of {} starts converged, to {} minima", m.converged, m.starts, m.objectives.len()));
    }
    if !said.is_empty() {
        out.push(Block::List(said));
    }
    out.extend(profiles(r));
    if !r.correlations.is_empty() {
        let row = |c: &ffid::workflow::identify::Correlation| {
            vec![Cell::words(c.first.clone()), Cell::words(c.second.clone()), Cell::number(format!("{:+.4}", c.value))]
        };
        let table = Table {
            caption: "Strong correlations".into(),
            head: ["", "", "coefficient"].map(String::from).to_vec(),
            rows: r.correlations.iter().map(row).collect(),
        };
        out.push(Block::Details(
            match r.correlations.len() {
                1 => "One pair with a correlation of 0.95 or more".to_owned(),
                n => format!("{n} pairs with a correlation of 0.95 or more"),
            },
            vec![Block::Table(table)],
        ));
    }
    let values: Vec<String> = r.singular_values.iter().map(|s| format!("{s:.4e}")).collect();
    out.push(Block::Details(
        "Singular values of the scaled sensitivities".into(),
        vec![Block::Code(values.join("  "))],
    ));
    out
}

fn warnings(r: &IdentificationResult) -> Vec<Block> {
    if r.warnings.is_empty() {
        Vec::new()
    } else {
        vec![Block::List(r.warnings.iter().map(|w| w.message.clone()).collect())]
    }
}

fn provenance(r: &IdentificationResult) -> Vec<Block> {
    let p = &r.provenance;
    let mut rows: Vec<(String, String)> = vec![
        ("program".into(), p.program.clone()),
        (
            "record".into(),
            format!(
                "{} samples at {} Hz, {:.4} s, from {} s",
                p.record.samples,
                num(p.record.rate_hz),
                p.record.seconds,
                p.record.t0
            ),
        ),
        ("noise".into(), format!("torque {} N m, gyro {} rad/s", num(p.noise_torque_nm), num(p.noise_gyro_rad_per_s))),
        (
            "fit".into(),
            if r.status.is_interrupted() {
                r.status.to_string()
            } else {
                format!("{} after {} linearisations", r.status, r.iterations)
            },
        ),
        ("chi-squared per degree of freedom".into(), format!("{:.6}", r.chi2_per_dof)),
    ];
    rows.extend(p.settings.iter().map(|(k, v)| (k.clone(), v.clone())));
    rows.extend(p.inputs.iter().map(|i| (i.file.clone(), format!("{} bytes, SHA-256 {}", i.bytes, i.sha256))));
    let rows = rows.into_iter().map(|(k, v)| vec![Cell::words(k), Cell::words(v)]).collect();
    let head = ["", ""].map(String::from).to_vec();
    vec![Block::Table(Table { caption: "Where this comes from".into(), head, rows })]
}
