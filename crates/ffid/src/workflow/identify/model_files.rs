//! The identified robot as files of the user's own kinds: his mission with the estimates in place, and his URDF.
//!
//! `identified.toml` is the mission file as it was, comments and all, with `urdf` (and every `*_file` key) pointing at the
//! copies beside it, and a section `[parameters]` that gives the estimates. It reloads to the same parameters **bit for
//! bit**; [`write()`] checks that before it hands the text out. Where the mission says how well it knows a parameter, a section `[prior_means]`
//! keeps the value that this is about: a record that is identified with the file tells what it tells once, be it the same or another. `identified.urdf` is the URDF with the `<inertial>` of every
//! estimated body replaced; a reader of URDFs computes the same body from it up to rounding (relative 1e-12 or better),
//! because a URDF counts inertia about the centre of mass, in decimal text.

use crate::exit::Failure;
use ff_mission::Leniency;
use ff_mission::mission::named_by;
use ff_mission::{LoadOptions, Mission};
use ff_model::diagnostics::text_file;
use ff_model::toml;
use ff_model::toml::Spanned;
use ff_model::toml::de::{DeTable, DeValue};
use ff_model::{Area, Problem, Problems};
use ff_model::{Inertia, Model};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Largest file that is copied or edited (bytes).
const MAX_BYTES: usize = 64 << 20;
/// Name of the mission file that is written.
pub const TOML: &str = "identified.toml";
/// Name of the URDF that is written.
pub const URDF: &str = "identified.urdf";

/// Files of an identified robot: name and content.
pub type Files = Vec<(String, Vec<u8>)>;

/// Everything that a reload of the identified mission needs, the mission file first, and warnings: a fit is not lost because its
/// files do not reload as they should.
///
/// * `Fit::Reload`: the mission reloads to other bits, or does not reload, or the URDF could not be edited and stays as it was.
/// * `Fit::Impossible`: a body breaks the triangle inequality of its moments.
///
/// # Errors
/// [`Failure::Io`] for a file that cannot be read, [`Failure::Numerical`] when the mission file cannot be edited at all.
pub fn write(
    mission_file: &Path,
    mission: &Mission,
    model: &Model,
    values: &[f64],
    selected: &[usize],
    leniency: &Leniency,
) -> Result<(Files, Problems), Failure> {
    let text = read(mission_file)?;
    let folder = mission_file.parent().unwrap_or(Path::new(""));
    let urdf = read(&folder.join(&mission.robot.urdf))?;
    let mut problems = Problems::default();
    let urdf = match self::urdf(&urdf, model, values, selected) {
        Ok(edited) => edited,
        Err(why) => {
            problems.push(warning(format!("{URDF} keeps the bodies of the mission: {why}")));
            urdf
        }
    };
    let decls = model.param_decls();
    let mut given = mission.parameters.clone();
    // All ten numbers of a body: the URDF gives those that were not estimated up to rounding only.
    let body = |i: usize| (i < 10 * model.n_bodies()).then_some(10 * (i / 10)..10 * (i / 10) + 10);
    let written = selected.iter().flat_map(|&i| body(i).unwrap_or(i..i + 1));
    given.extend(written.map(|i| (decls[i].name.clone(), values[i])));
    let mut extra: Files = Vec::new();
    let mut copies: BTreeMap<String, String> = BTreeMap::new();
    for path in named_files(&text) {
        let bytes = std::fs::read(folder.join(&path)).map_err(|e| Failure::io("read", &folder.join(&path), e))?;
        let stem = Path::new(&path).file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut name = stem.clone();
        let mut k = 1;
        while name == TOML || name == URDF || extra.iter().any(|(n, _)| *n == name) {
            name = format!("{k}-{stem}");
            k += 1;
        }
        extra.push((name.clone(), bytes));
        copies.insert(path, name);
    }
    // The user's own text where it can be edited; else the same tables printed anew.
    let mut first: Option<(String, String)> = None;
    let mut good = None;
    let given = (&given, &mission.prior_means);
    for edited in [edit(&text, given, &copies), printed(&text, given, &copies)].into_iter().flatten() {
        match reloads(&edited, &urdf, &extra, values, leniency) {
            Ok(()) => {
                good = Some(edited);
                break;
            }
            Err(why) => first = first.or(Some((edited, why))),
        }
    }
    let edited = match (good, first) {
        (Some(edited), _) => edited,
        (None, Some((edited, why))) => {
            problems.push(warning(format!("{TOML} does not reload to the estimates bit for bit: {why}")));
            edited
        }
        (None, None) => return Err(Failure::Numerical("the mission file cannot be edited".to_owned())),
    };
    problems.0.extend((0..model.n_bodies()).filter_map(|b| impossible(model, values, selected, b)));
    let mut files = vec![(TOML.to_owned(), edited.into_bytes()), (URDF.to_owned(), urdf.into_bytes())];
    files.append(&mut extra);
    Ok((files, problems))
}

/// `[prior_means]` of a mission whose parameters are given other `values`, estimates from a record: what was known of them before is about those
/// that it, or `model`, had until then. `prior`: the fit had a prior about everything. Allocates.
pub fn prior_means(mission: &Mission, prior: bool, model: &Model, values: &[f64]) -> BTreeMap<String, f64> {
    let mut means = mission.prior_means.clone();
    let known = |name: &str| prior || mission.estimate.prior_relative_std.is_some() || is_uncertain(mission, name);
    for (d, _) in model.param_decls().iter().zip(values).filter(|(d, x)| d.nominal != **x && known(&d.name)) {
        means.entry(d.name.clone()).or_insert(d.nominal);
    }
    means
}

/// Whether `[[uncertain]]` says how well this parameter, or the body that it belongs to, is known.
fn is_uncertain(mission: &Mission, name: &str) -> bool {
    let of_body = name.rsplit_once('.').map(|n| n.0);
    mission.uncertain.iter().any(|u| named_by(&u.parameters, name) || of_body.is_some_and(|b| named_by(&u.bodies, b)))
}

/// A body that was estimated beside and cannot exist: its errors are known with deviations alone, which reach beyond what can be.
fn impossible(model: &Model, values: &[f64], selected: &[usize], b: usize) -> Option<Problem> {
    let own = 10 * b..10 * b + 10;
    let touched = selected.iter().any(|i| own.contains(i));
    let why = Inertia::from_params(&values[own]).check().err().filter(|_| touched)?;
    let p = Problem::warning(Area::Data, "Fit::Impossible", format!("estimated beside: {why}"));
    Some(
        p.on(model.body_name(b))
            .hint("the record hardly tells this body: give a smaller deviation in [[uncertain]], or weigh it"),
    )
}

/// What is wrong with the files of an identified robot.
fn warning(what: String) -> Problem {
    Problem::warning(Area::Data, "Fit::Reload", what)
        .hint("take the estimates from result.json, which holds them exactly")
}

fn read(path: &Path) -> Result<String, Failure> {
    text_file(path, MAX_BYTES).map_err(|p| Failure::io("read", path, std::io::Error::other(p.to_string())))
}

/// Loads what is to be written, from a folder of its own, and compares every parameter.
fn reloads(toml: &str, urdf: &str, extra: &Files, values: &[f64], leniency: &Leniency) -> Result<(), String> {
    let folder = Scratch::new().map_err(|e| e.to_string())?;
    let put = |name: &str, bytes: &[u8]| std::fs::write(folder.0.join(name), bytes).map_err(|e| e.to_string());
    put(TOML, toml.as_bytes())?;
    put(URDF, urdf.as_bytes())?;
    for (name, bytes) in extra {
        put(name, bytes)?;
    }
    // What was a warning before is one again; it must not refuse here.
    let options = LoadOptions { leniency: Leniency { strict: false, ..leniency.clone() } };
    let loaded =
        Mission::load(&folder.0.join(TOML), &crate::default_registry(), &options).map_err(|p| p.to_string())?;
    for (d, want) in loaded.model.param_decls().iter().zip(values) {
        if d.nominal.to_bits() != want.to_bits() {
            return Err(format!("{} is {} instead of {want}", d.name, d.nominal));
        }
    }
    if loaded.model.n_params() == values.len() { Ok(()) } else { Err("another number of parameters".into()) }
}

/// A folder that goes when it is done with.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> std::io::Result<Self> {
        let mut k = 0;
        loop {
            let name = format!("ffid-reload-{}-{k}", std::process::id());
            let path = std::env::temp_dir().join(name);
            match std::fs::create_dir(&path) {
                Ok(()) => return Ok(Self(path)),
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists && k < 1000 => k += 1,
                Err(e) => return Err(e),
            }
        }
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed stays in the folder for temporary files.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Values of keys that end with `_file` in `[[appendage]]`, in order, each once.
fn named_files(text: &str) -> Vec<String> {
    let mut out = Vec::new();
    file_keys(text, &mut |_, path| {
        if !out.contains(&path) {
            out.push(path);
        }
    });
    out
}

fn file_keys(text: &str, f: &mut impl FnMut(Range<usize>, String)) {
    let Ok(doc) = DeTable::parse(text) else { return };
    if let Some(v) = doc.get_ref().get("appendage") {
        walk("", v, f);
    }
}

fn walk(key: &str, v: &Spanned<DeValue<'_>>, f: &mut impl FnMut(Range<usize>, String)) {
    match v.get_ref() {
        DeValue::String(s) if key.ends_with("_file") => f(v.span(), s.to_string()),
        DeValue::Array(a) => a.iter().for_each(|x| walk(key, x, f)),
        DeValue::Table(t) => t.iter().for_each(|(k, x)| walk(k.get_ref(), x, f)),
        _ => {}
    }
}

fn quoted(s: &str) -> String {
    toml::Value::String(s.to_owned()).to_string()
}

/// A number that TOML reads as one with a fraction, and to the same bits.
fn number(x: f64) -> String {
    let (plain, exp) = (format!("{x:?}"), format!("{x:e}"));
    if plain.len() <= exp.len() { plain } else { exp }
}

/// Estimates, and what priors are about.
type Values<'a> = (&'a BTreeMap<String, f64>, &'a BTreeMap<String, f64>);

/// The text with its values replaced in place, and sections of parameters at the end; `None` when it has such a section
/// in a form that cannot be edited so.
fn edit(text: &str, (given, means): Values<'_>, copies: &BTreeMap<String, String>) -> Option<String> {
    let doc = DeTable::parse(text).ok()?;
    let root = doc.get_ref();
    let mut changes: Vec<(Range<usize>, String)> = Vec::new();
    if let DeValue::Table(robot) = root.get("robot")?.get_ref() {
        changes.push((robot.get("urdf")?.span(), quoted(URDF)));
    }
    file_keys(text, &mut |span, path| {
        if let Some(name) = copies.get(&path) {
            changes.push((span, quoted(name)));
        }
    });
    for (section, values, comment) in [
        (
            "parameters",
            given,
            "# Estimates of `ffid identify`: these values replace those that the URDF and the sections above lead to.",
        ),
        (
            "prior_means",
            means,
            "# What the mission said before: deviations of [[uncertain]] and priors are about these values and not about the estimates, so that\n\
             # a record that is identified with this file counts once. To go on from what was learnt: ffid identify --prior-from this folder.",
        ),
    ] {
        let header = format!("[{section}]");
        let mut left = values.clone();
        let (mut lines, mut insert) = (format!("\n{comment}\n{header}\n"), text.len());
        if let Some(v) = root.get(section) {
            let DeValue::Table(old) = v.get_ref() else { return None };
            for (k, x) in old.iter() {
                let name: &str = k.get_ref();
                if let Some(value) = left.remove(name) {
                    changes.push((x.span(), number(value)));
                }
            }
            // What is new goes right behind the line of the header.
            let at = text
                .match_indices(&header)
                .find(|(i, _)| text[..*i].rsplit('\n').next().is_some_and(|before| before.trim().is_empty()))?;
            insert = text[at.0..].find('\n').map_or(text.len(), |i| at.0 + i + 1);
            lines.clear();
        } else if values.is_empty() {
            continue;
        }
        for (name, x) in &left {
            // Writing to a text cannot fail.
            let _ = writeln!(lines, "{} = {}", quoted(name), number(*x));
        }
        changes.push((insert..insert, lines));
    }
    changes.sort_by_key(|(r, _)| (r.start, r.end));
    let mut out = String::with_capacity(text.len() + 64 * given.len());
    let mut at = 0;
    for (r, new) in changes {
        if r.start < at {
            return None;
        }
        out.push_str(&text[at..r.start]);
        if r.is_empty() && r.start == text.len() && !out.ends_with('\n') {
            out.push('\n');
        }
        out.push_str(&new);
        at = r.end;
    }
    out.push_str(&text[at..]);
    Some(out)
}

/// The same tables printed anew, without comments.
fn printed(text: &str, (given, means): Values<'_>, copies: &BTreeMap<String, String>) -> Option<String> {
    let mut root: toml::Table = text.parse().ok()?;
    root.get_mut("robot")?.as_table_mut()?.insert("urdf".into(), toml::Value::String(URDF.into()));
    if let Some(v) = root.get_mut("appendage") {
        rename("", v, copies);
    }
    for (section, values) in [("parameters", given), ("prior_means", means)].into_iter().filter(|s| !s.1.is_empty()) {
        let values = values.iter().map(|(k, x)| (k.clone(), toml::Value::Float(*x))).collect();
        root.insert(section.into(), toml::Value::Table(values));
    }
    toml::to_string(&root).ok()
}

fn rename(key: &str, v: &mut toml::Value, copies: &BTreeMap<String, String>) {
    match v {
        toml::Value::String(s) if key.ends_with("_file") => {
            if let Some(name) = copies.get(s.as_str()) {
                *s = name.clone();
            }
        }
        toml::Value::Array(a) => a.iter_mut().for_each(|x| rename(key, x, copies)),
        toml::Value::Table(t) => t.iter_mut().for_each(|(k, x)| rename(k, x, copies)),
        _ => {}
    }
}

/// The URDF with the estimated bodies in place: the link that moves carries the whole body, links fixed to it none.
fn urdf(text: &str, model: &Model, values: &[f64], selected: &[usize]) -> Result<String, String> {
    let doc = roxmltree::Document::parse(text).map_err(|e| e.to_string())?;
    let link = |name: &str| {
        doc.root_element().children().find(|n| n.has_tag_name("link") && n.attribute("name") == Some(name))
    };
    let mut changes: Vec<(Range<usize>, String)> = Vec::new();
    let mut put = |name: &str, body: &Inertia<f64>| {
        let Some(node) = link(name) else { return };
        let new = inertial(body);
        if let Some(old) = node.children().find(|n| n.has_tag_name("inertial")) {
            changes.push((old.range(), new));
            return;
        }
        let whole = &text[node.range()];
        match node.children().next() {
            Some(first) => changes.push((first.range().start..first.range().start, format!("\n    {new}"))),
            None => {
                // `<link name="x"/>` or `<link name="x"></link>`.
                let open = whole.split('>').next().unwrap_or(whole).trim_end_matches('/');
                changes.push((node.range(), format!("{open}>\n    {new}\n  </link>")));
            }
        }
    };
    for body in 0..model.n_bodies() {
        if !selected.iter().any(|i| (10 * body..10 * body + 10).contains(i)) {
            continue;
        }
        put(model.body_name(body), &Inertia::from_params(&values[10 * body..10 * body + 10]));
        for f in model.frames().iter().filter(|f| f.body == body && f.name != model.body_name(body)) {
            // A link fixed to the body, whose mass is now in the body; frames without mass stay as they are.
            let has = link(&f.name).and_then(|n| n.children().find(|c| c.has_tag_name("inertial")));
            if has.is_some() {
                put(&f.name, &Inertia::zero());
            }
        }
    }
    changes.sort_by_key(|(r, _)| r.start);
    let (mut out, mut at) = (String::with_capacity(text.len()), 0);
    for (r, new) in changes {
        out.push_str(text.get(at..r.start).ok_or("links overlap")?);
        out.push_str(&new);
        at = r.end;
    }
    out.push_str(&text[at..]);
    Ok(out)
}

/// `<inertial>` of a body about its own frame, inertia about the centre of mass.
fn inertial(body: &Inertia<f64>) -> String {
    let c = body.com().unwrap_or_default();
    let i = body.about_com();
    format!(
        "<inertial>\n      <origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/>\n      <mass value=\"{}\"/>\n      \
         <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n    </inertial>",
        c.x,
        c.y,
        c.z,
        body.mass,
        i[(0, 0)],
        i[(0, 1)],
        i[(0, 2)],
        i[(1, 1)],
        i[(1, 2)],
        i[(2, 2)]
    )
}

#[cfg(test)]
#[path = "model_files_tests.rs"]
mod tests;
